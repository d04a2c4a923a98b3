// Small helpers to build the page: elements, numbers with units, notices.

/** An HTML element: attributes, `on…` listeners and children. */
export function h(tag, attributes = {}, ...children) {
  return fill(document.createElement(tag), attributes, children);
}

/** An SVG element. */
export function s(tag, attributes = {}, ...children) {
  return fill(document.createElementNS("http://www.w3.org/2000/svg", tag), attributes, children);
}

function fill(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "style") Object.assign(element.style, value);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value != null) element.setAttribute(name, value);
  }
  element.append(...children.flat().filter((child) => child != null && child !== false));
  return element;
}

/** Date and time of this computer's clock, the same in every language; a dash for no time. @param {number} unix_ms */
export function when(unix_ms) {
  if (!Number.isFinite(unix_ms)) return "–";
  const date = new Date(unix_ms);
  return new Date(unix_ms - 60_000 * date.getTimezoneOffset()).toISOString().slice(0, 19).replace("T", " ");
}

/** A number with so many decimals, a proper minus, and its unit. */
export function number(value, decimals = 0, unit = "") {
  if (value == null || !Number.isFinite(value)) return "–";
  const text = value.toFixed(decimals).replace("-", "−");
  return unit ? `${text} ${unit}` : text;
}

/** A labelled control. */
export function field(label, control, unit) {
  const id = control.id || `field-${++fields}`;
  control.id = id;
  if (unit && !control.title) control.setAttribute("aria-describedby", `${id}-unit`);
  return h("div", { class: "field" }, h("label", { for: id }, label), control, unit ? h("span", { class: "unit", id: `${id}-unit` }, unit) : null);
}
let fields = 0;

/** A choice of values with their words. */
export function choice(values, chosen, onchange, attributes = {}) {
  const options = values.map(([value, text]) => h("option", { value, selected: value === chosen }, text));
  return h("select", { ...attributes, onchange: (event) => onchange(event.target.value) }, options);
}

/** A panel with a heading. */
export function panel(title, ...children) {
  return h("section", { class: "panel" }, h("h2", {}, title), ...children);
}

/** A button. */
export function button(text, onclick, attributes = {}) {
  return h("button", { type: "button", onclick, ...attributes }, text);
}

/** Lets a control be used, or not. A browser takes the focus from a disabled control: one that has the focus is only marked, and `ignoreMarked` drops its clicks.
 * @param {HTMLButtonElement | HTMLInputElement} control @param {boolean} able */
export function allow(control, able) {
  control.setAttribute("aria-disabled", String(!able));
  control.disabled = !able && control !== document.activeElement;
}

/** Drops clicks on controls that are marked as disabled. */
export function ignoreMarked() {
  addEventListener("click", (event) => {
    if (!(event.target instanceof Element && event.target.closest("[aria-disabled=true]"))) return;
    event.preventDefault();
    event.stopImmediatePropagation();
  }, { capture: true });
}

/** Rows of a name and a value. */
export function rows(pairs) {
  return h("dl", { class: "rows" }, pairs.filter(Boolean).map(([name, value]) => [h("dt", {}, name), h("dd", {}, value)]).flat());
}

/** Tells a screen reader what the eye sees elsewhere. @param {string} text */
export function say(text) {
  const place = /** @type {HTMLElement} */ (document.getElementById("said"));
  place.textContent = text;
}

/** Tells something that goes away by itself; an error stays until it is closed. */
export function notice(text, kind = "info", hint, about = "") {
  const place = /** @type {HTMLElement} */ (document.getElementById("notices"));
  const close = () => {
    const within = box.contains(document.activeElement);
    box.remove();
    if (within) refocus(place.querySelector("button"));
  };
  const box = h("div", { class: `notice ${kind}`, "data-about": about }, h("p", {}, text), hint ? h("p", { class: "dim" }, hint) : null,
    button("×", close, { "aria-label": "Close", class: "quiet" }));
  for (const old of [...place.children].slice(0, -2)) old.remove();
  place.append(box);
  if (kind !== "error") setTimeout(close, 5000);
}

/** Moves the focus; to the view where the wanted control has gone. @param {HTMLElement | null | undefined} [wanted] */
export function refocus(wanted) {
  (wanted ?? document.getElementById("view"))?.focus({ preventScroll: true });
}

/** A value that the browser keeps, or null; with `value`, keeps or removes it. A browser may refuse to keep anything.
 * @param {"localStorage" | "sessionStorage"} where @param {string} name @param {string | null} [value] @returns {string | null} */
export function kept(where, name, value) {
  try {
    if (value === undefined) return window[where].getItem(name);
    if (value === null) window[where].removeItem(name);
    else window[where].setItem(name, value);
  } catch {
    // Without it a reload loses control, and the colours are those of the system.
  }
  return null;
}

/** Removes errors that are obsolete: of an earlier job of this kind. @param {string} about */
export function dropErrors(about) {
  for (const old of document.querySelectorAll("#notices .notice.error")) if (/** @type {HTMLElement} */ (old).dataset.about === about) old.remove();
}

/** What is drawn with on a canvas. @param {HTMLCanvasElement} canvas */
export function pen(canvas) {
  return /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
}

/** A value of a colour of the style sheet, as it is now. */
export function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

/** Opens a dialog above the page. It is not modal: Stop must work while it is open. Esc calls `onescape`.
 * Returns the function that closes the dialog; the focus goes back to where it was.
 * @param {string} label @param {any[]} children @param {() => void} onescape */
export function popUp(label, children, onescape) {
  const dialog = h("dialog", { class: "dialog", tabindex: -1, "aria-label": label }, children);
  /** @param {KeyboardEvent} event */
  const escape = (event) => event.key === "Escape" && onescape();
  addEventListener("keydown", escape);
  const typing = document.activeElement?.matches("input, textarea, select");
  document.body.append(dialog);
  dialog.show();
  // Keys typed at this moment are meant for another field.
  if (typing) dialog.focus();
  return () => {
    removeEventListener("keydown", escape);
    dialog.close();
    dialog.remove();
  };
}

/** Asks for a text; null where the person gave up, or where `signal` withdrew the question.
 * @param {string} question @param {{ text?: boolean, yes?: string, no?: string, signal?: AbortSignal }} options @returns {Promise<string | null>} */
export function ask(question, { text = false, yes = "Continue", no = "Cancel", signal } = {}) {
  return new Promise((done) => {
    const input = h("input", { type: "text", "aria-label": "Answer", hidden: !text });
    /** @param {string | null} answer */
    const finish = (answer) => { close(); done(answer); };
    const close = popUp(question, [h("p", {}, question), input,
      h("div", { class: "actions" }, button(no, () => finish(null)), button(yes, () => finish(input.value), { class: "primary" }))], () => finish(null));
    input.addEventListener("keydown", (event) => {
      if (event.key !== "Enter") return;
      event.preventDefault(); // the button that gets the focus back is not pressed
      finish(input.value);
    });
    signal?.addEventListener("abort", () => finish(null), { once: true });
  });
}

/** Whether an input has another text than was typed. A value that the page has set since then is right. @param {HTMLInputElement} input */
export const altered = (input) => input.dataset.typed !== undefined && input.dataset.typed === input.value;

/** The number in an input; null where it is empty. The browser gives an empty value also for a text that is not a number: only `badInput` differs.
 * @param {HTMLInputElement} input @returns {number | null} */
export function optional(input) {
  if (input.validity.badInput || altered(input)) throw wrong(input, "expected a number");
  return input.value === "" ? null : Number(input.value);
}

/** The number in an input that must have one. @param {HTMLInputElement} input */
export function numeric(input) {
  const value = optional(input);
  if (value === null) throw wrong(input, "expected a number, the field is empty");
  return value;
}

/** Marks an input until it is changed, and gives the error. @param {HTMLInputElement} input @param {string} text */
function wrong(input, text) {
  input.setAttribute("aria-invalid", "true");
  input.addEventListener("input", () => altered(input) || input.removeAttribute("aria-invalid"), { once: true });
  return new Error(`${nameOf(input)}: ${text}`);
}

/** @param {HTMLInputElement} input */
const nameOf = (input) => input.getAttribute("aria-label") ?? input.labels?.[0]?.textContent ?? "value";

/** Words that are there already cost nothing. @param {HTMLElement} place @param {string} text */
export function write(place, text) {
  if (place.textContent !== text) place.textContent = text;
}

/** Fills a place anew only when `key` changes: a button that is replaced under a click is not pressed. */
export function keep(host, key, build) {
  const text = JSON.stringify(key);
  if (host.dataset.key === text) return;
  host.dataset.key = text;
  const within = host.contains(document.activeElement);
  host.replaceChildren(...[build()].flat());
  if (within) refocus();
}
