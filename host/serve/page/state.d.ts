// What the program tells the page, for the page's type check: `/openapi.json` has the same, word for word, with what each means.
export interface Job {
  id: number;
  kind: string;
  title: string;
  phase: "running" | "done" | "failed" | "stopped";
  said: string | null;
  warnings: string[];
  progress: { unit: string; done: number; total: number | null } | null;
  /** The figures of its kind. */
  result: any;
  error: string | null;
  hint: string | null;
}
export interface State {
  rig: {
    phase: "absent" | "connecting" | "ready" | "lost";
    name: string | null;
    emulated: boolean;
    scene: string | null;
    error: string | null;
    /** As `farnear rig info --json` prints it. */
    info: any;
  };
  job: Job | null;
  computation: Job | null;
  live: {
    mode: "off" | "image" | "depth";
    exposure_us: number;
    light_percent: [number, number];
    measure: string;
    region: [number, number, number, number] | null;
    error: string | null;
    recording: string | null;
    recording_ended: string | null;
    /** A camera without a rig: its image can be seen live. */
    camera_alone: boolean;
  };
  control: { holder: number | null; requested_by: number | null; clients: number };
  question: string | null;
  questions: number;
  captures: number;
  optics: number;
  log: number;
}
export interface Hello {
  client: number;
  secret: string;
  server: string;
}
