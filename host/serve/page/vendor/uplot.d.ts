// What the page uses of uPlot, for its type check.
interface Plot {
  width: number;
  setSize(size: { width: number; height: number }): void;
  setData(data: (number | null)[][]): void;
  destroy(): void;
}
declare const uPlot: { new (options: object, data: (number | null)[][], host: HTMLElement): Plot };
export default uPlot;
