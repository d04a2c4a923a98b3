// Camera settings other than exposure: gain, black level, pixel format, region.
import { act, hasControl, ended, on } from "./link.js";
import { h, allow, button, choice, field, rows } from "./ui.js";

/** @typedef {{ name: string, value: string, range: string }} Control */

/** In words, with the unit or form that is typed. */
const WORDS = { gain: "Gain", black_level: "Black level", pixel_format: "Format", region: "Region", trigger_source: "Trigger" };
const CHOICES = ["pixel_format", "trigger_source"];

/** What is shown of the camera when it is asked for; it is opened for that. */
export function make() {
  const place = h("div", { class: "details" });
  const set = button("Set", () => look([...place.querySelectorAll("[name]")].filter((control) => control.value !== control.dataset.was).map((control) => `${control.name}=${control.value.trim()}`)));
  const element = h("details", { class: "camera" }, h("summary", {}, "Gain, region and what else it has"), place);
  element.addEventListener("toggle", () => element.open && hasControl() && look([]));
  on("state", ({ rig, live, job }) => {
    allow(set, hasControl() && (rig.phase === "ready" || live.camera_alone) && job?.phase !== "running");
  });

  async function look(wishes) {
    if (!wishes.length && place.querySelector("[name]")) return;
    const begun = await act("/api/camera", { set: wishes });
    if (!begun) return;
    const job = await ended("job", begun.job);
    if (job.phase === "done") show(job.result);
  }

  /** @param {{ kind: string, controls: Control[] }} camera */
  function show({ kind, controls }) {
    const settable = controls.filter(({ name }) => name in WORDS);
    const facts = controls.filter(({ name }) => !(name in WORDS) && name !== "exposure_us");
    if (!settable.length) {
      place.replaceChildren(h("p", { class: "dim" }, `A camera of the kind ${kind} has nothing to set but its exposure.`));
      return;
    }
    const one = ({ name, value, range }) => {
      const names = range.split(", ");
      const attributes = { name, "data-was": value, title: range };
      const control = CHOICES.includes(name) ? choice(names.map((other) => [other, other]), value, () => {}, attributes)
        : h("input", { type: "text", inputmode: name === "region" ? "text" : "decimal", value, ...attributes });
      const about = name === "region" ? "column, row, width, height in px" : CHOICES.includes(name) ? "" : range;
      return [field(WORDS[name], control), about ? h("p", { class: "dim about" }, about) : null];
    };
    place.replaceChildren(...settable.flatMap(one).filter(Boolean), h("div", { class: "buttons" }, set), rows(facts.map(({ name, value }) => [name, value])));
  }
  return element;
}
