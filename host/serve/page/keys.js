// The keyboard. Esc stops the rig from anywhere, also while something is typed.
import { stop } from "./link.js";
import { h, button, popUp } from "./ui.js";

const keys = new Map();

/** A key with what it does, and the words for it. */
export function key(name, about, action) {
  keys.set(name, { about, action });
}

/** Listens to the keyboard. */
export function listen() {
  key("?", "This list", help);
  addEventListener("keydown", (event) => {
    if (event.key === "Escape") {
      stop();
      return;
    }
    const typing = event.target instanceof Element && event.target.matches("input, textarea, select, [contenteditable], dialog *, [role=application]");
    if (typing || event.ctrlKey || event.metaKey || event.altKey) return;
    const found = keys.get(event.key) ?? keys.get(event.key.toLowerCase());
    if (found) {
      event.preventDefault();
      found.action();
    }
  }, { capture: true });
}

/** Shows the keys. */
export function help() {
  const close = popUp("Keys", [h("h2", {}, "Keys"),
    h("dl", { class: "rows" }, h("dt", {}, h("kbd", {}, "Esc")), h("dd", {}, "Stop all motion"),
      [...keys].map(([name, { about }]) => [h("dt", {}, h("kbd", {}, name)), h("dd", {}, about)]).flat()),
    h("div", { class: "actions" }, button("Close", () => close(), { class: "primary" }))], () => close());
}
