// Messages, and the alarms in the board's memory, each with its remedy.
import { act, hasControl, get, on, store } from "./link.js";
import { h, button, number, panel, when } from "./ui.js";

/** Makes the view. */
export function make(host) {
  const lines = h("pre", { class: "log", tabindex: 0, "aria-label": "Log" });
  const alarms = h("ul", { class: "alarms" });
  host.append(h("div", { class: "split" }, h("div", { class: "stage" }, lines),
    h("div", { class: "side" }, panel("Alarms of the board", alarms, button("Read again", read)))));
  let seen = -1;
  async function refresh() {
    const end = lines.scrollTop + lines.clientHeight > lines.scrollHeight - 40;
    const { lines: all } = await get("/api/log");
    lines.textContent = all.map(({ unix_ms, text }) => `${when(unix_ms)}  ${text}`).join("\n");
    if (end) lines.scrollTop = lines.scrollHeight;
  }
  async function read() {
    try {
      const { figures } = await get("/api/rig/alarms");
      alarms.replaceChildren(...figures.alarms.map((alarm) => h("li", { class: alarm.number === figures.latched ? "latched" : "" },
        h("p", {}, h("b", {}, `${alarm.number}`), ` ${alarm.text}`), h("p", { class: "dim" }, `boot ${alarm.boot}, after ${number(alarm.time_s, 3)} s`),
        alarm.number === figures.latched && hasControl() ? button("Clear", () => act("/api/rig/alarms/clear", { number: alarm.number })) : null)));
      if (!figures.alarms.length) alarms.append(h("li", { class: "dim" }, "None."));
    } catch (error) {
      alarms.replaceChildren(h("li", { class: "dim" }, error.message));
    }
  }
  on("state", (state, before) => {
    if (host.hidden) return;
    if (state.log !== seen) refresh().catch(() => {});
    seen = state.log;
    if (state.rig.info?.alarm !== before?.rig.info?.alarm) read();
  });
  return { shown: () => { seen = store.state?.log ?? -1; refresh().catch(() => {}); read(); } };
}
