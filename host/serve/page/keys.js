// The keyboard. Esc stops the rig from anywhere, also while something is typed.
import { stop } from "./link.js";
import { h, button, kept, notice, popUp } from "./ui.js";

const keys = new Map();

/** Where the browser keeps that letters, digits and signs are not keys. Speech input types them by accident. */
const SETTING = "farnear-keys";
let single = kept("localStorage", SETTING) !== "off";

/** A key with what it does, and the words for it. */
export function key(name, about, action) {
  keys.set(name, { about, action });
}

/** Some browsers drop these from a number: "12,5" becomes 125, and a minus copied from the page is lost. */
const DROPPED = /[,\u066b\u2212]/;

/** Such a number is not used until a part of it is deleted. */
function refuse(event) {
  const { target, data } = event;
  if (!(target instanceof HTMLInputElement && target.type === "number" && data && DROPPED.test(data))) return;
  event.preventDefault();
  target.setAttribute("aria-invalid", "true");
  target.dataset.typed = target.value;
  notice(`${data}: expected a number with a decimal point, and a hyphen as the minus`, "warning");
}

function accept({ target }) {
  if (!(target instanceof HTMLInputElement && target.dataset.typed !== undefined)) return;
  if (target.value.length > target.dataset.typed.length) target.dataset.typed = target.value;
  else {
    target.removeAttribute("aria-invalid");
    delete target.dataset.typed;
  }
}

/** Listens to the keyboard. */
export function listen() {
  key("?", "This list", help);
  addEventListener("beforeinput", refuse);
  addEventListener("input", accept);
  addEventListener("keydown", (event) => {
    if (event.key === "Escape") {
      stop();
      return;
    }
    const typing = event.target instanceof Element && event.target.matches("input, textarea, select, [contenteditable], dialog, dialog *, [role=application]");
    // A key that is held down acts once: the page would flash, or the rig get a request for each repetition.
    if (!single || typing || event.repeat || event.ctrlKey || event.metaKey || event.altKey) return;
    const found = keys.get(event.key) ?? keys.get(event.key.toLowerCase());
    if (found) {
      event.preventDefault();
      found.action();
    }
  }, { capture: true });
}

/** Closes the list. @type {(() => void) | undefined} */
let close;

/** Shows the keys, and whether they are in use. */
export function help() {
  close?.();
  const use = h("input", { type: "checkbox", checked: single, onchange: () => {
    single = use.checked;
    kept("localStorage", SETTING, single ? null : "off");
  } });
  close = popUp("Keys", [h("h2", {}, "Keys"),
    h("dl", { class: "rows" }, h("dt", {}, h("kbd", {}, "Esc")), h("dd", {}, "Stop all motion"),
      [...keys].map(([name, { about }]) => [h("dt", {}, h("kbd", {}, name)), h("dd", {}, about)]).flat()),
    h("label", { class: "check" }, use, "Use these keys; Esc always stops"),
    h("div", { class: "actions" }, button("Close", () => close?.(), { class: "primary" }))], () => close?.());
}
