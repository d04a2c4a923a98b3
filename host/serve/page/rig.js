// The rig: how it is, and moving it. Always in reach.
import { act, call, hasControl, get, on, store } from "./link.js";
import { h, allow, button, choice, keep, notice, number, numeric, rows } from "./ui.js";
import { draw, listen } from "./stages.js";
import { key } from "./keys.js";

const STEPS = [[0.1, "0.1"], [1, "1"], [10, "10"], [100, "100"], [1000, "1000"]];
let range = null;

const findFocus = () => {
  const { measure, region } = store.state?.live ?? {};
  return act("/api/rig/focus", { range_mm: 0.5, measure, region: region?.join(",") });
};

/** Fills the panel on the left. */
export function mount(host) {
  const stages = h("div", { class: "stages", title: "Click a rail to move its stage there" });
  listen(stages, (axis, to_um) => able() && act("/api/rig/move", { axis: [axis], to_um: [to_um] }));
  const phase = h("div", { class: "phase" });
  const axes = h("div", { class: "axes" }, axis("coarse", "Coarse", 100), axis("fine", "Piezo", 1), axis("lens", "Lens", 100));
  const whole = h("div", { class: "buttons" },
    button("Home", () => act("/api/rig/home"), { title: "Homes all stages (H)", "data-needs": "control" }),
    button("Far focus", () => act("/api/rig/goto", { focus: "far" }), { title: "F", "data-needs": "control" }),
    button("Near focus", () => act("/api/rig/goto", { focus: "near" }), { title: "N", "data-needs": "control" }),
    button("Find focus", findFocus, { title: "Searches for the sharpest image, in the region drawn in the live image if there is one", "data-needs": "control" }));
  const facts = h("div", {});
  const more = h("details", {}, h("summary", {}, "More"), h("div", { class: "details" }, facts, h("div", { class: "buttons" },
    button("Bring-up checklist", () => act("/api/rig/check"), { "data-needs": "control" }),
    button("Reset the board", () => act("/api/rig/reset"), { "data-needs": "control" }),
    button("Emergency stop", () => act("/api/halt"), { class: "danger" }))));
  host.append(h("h2", { class: "visually-hidden" }, "Rig"), phase, stages, whole, axes, more);

  const show = (state) => {
    const { rig } = state;
    keep(phase, [rig.phase, rig.name, rig.error, rig.emulated, rig.scene, hasControl()], () => phaseWords(rig));
    if (rig.info) draw(stages, rig.info, range);
    stages.hidden = !rig.info;
    if (more.open) facts.replaceChildren(details(rig));
    stages.classList.toggle("able", able());
    for (const control of host.querySelectorAll("[data-needs=control]")) allow(control, able());
  };
  on("state", (state, before) => {
    if (!before || state.optics !== before.optics) measure().then(() => store.state && show(store.state));
    show(state);
  });
  more.addEventListener("toggle", () => store.state && show(store.state));
  key("h", "Home all stages", () => act("/api/rig/home"));
  key("f", "Go to the far focus", () => act("/api/rig/goto", { focus: "far" }));
  key("n", "Go to the near focus", () => act("/api/rig/goto", { focus: "near" }));
  key("[", "Piezo one step towards the lens", () => step("fine", -1));
  key("]", "Piezo one step away from the lens", () => step("fine", 1));
}

function able() {
  return hasControl() && store.state?.rig.phase === "ready";
}

const SCENES = [["staircase", "Staircase"], ["slant", "Slanted plane"], ["cone", "Cone"], ["sphere", "Sphere"]];
const FLAT = /^plane:(.+)$/;
const USUAL_MM = 900;

/** Chooses the scene of the emulated rig. @param {string} scene */
function sceneChoice(scene) {
  const flat = FLAT.exec(scene)?.[1];
  const known = flat || SCENES.some(([name]) => name === scene);
  const set = async (to) => {
    if (await act("/api/rig/scene", () => ({ scene: to === "plane" ? `plane:${numeric(distance)}` : to }))) return;
    [chosen.value, distance.value] = [flat ? "plane" : scene, flat ?? USUAL_MM];
  };
  const distance = h("input", { type: "number", min: 1, step: "any", value: flat ?? USUAL_MM, "aria-label": "Distance of the flat target, mm", title: "Distance of the flat target", disabled: !hasControl() });
  distance.addEventListener("change", () => set("plane"));
  const names = [...(known ? [] : [[scene, scene]]), ...SCENES, ["plane", "Flat target"]];
  const chosen = choice(names, flat ? "plane" : scene, set, { "aria-label": "Scene", title: "Restarts the emulated rig with this scene", disabled: !hasControl() });
  return h("div", { class: "row scene-choice" }, h("span", { class: "dim" }, "Scene"), chosen, h("span", { class: "unit", hidden: !flat }, distance, " mm"));
}

/** The working range of the optics in use. */
async function measure() {
  try {
    const { optics } = await get("/api/optics");
    range = (await call("POST", "/api/optics/calculate", { optics })).figures.range;
  } catch (error) {
    notice(error.message, "error", error.hint);
  }
}

function phaseWords(rig) {
  const scene = rig.scene ? [sceneChoice(rig.scene)] : [];
  const again = button("Connect again", () => act("/api/rig/connect"), { "data-needs": "client" });
  if (rig.phase === "absent") return [h("p", { class: "dim" }, "No rig: captures only. Start farnear serve with --rig sim or a port to drive one.")];
  if (rig.phase === "connecting") return [h("p", {}, `Connecting to ${rig.name} …`)];
  if (rig.phase === "lost" && rig.emulated) return [h("p", { class: "bad" }, "The emulated rig has ended, or does not answer."), h("p", { class: "dim" }, `${rig.error ?? ""} Connect again to restart it; its stages are not homed then.`), again, ...scene];
  if (rig.phase === "lost") return [h("p", { class: "bad" }, rig.error ?? "The rig does not answer."), again];
  return [h("p", { class: "rig-name" }, rig.name, rig.emulated ? h("span", { class: "badge", title: "No hardware is involved" }, "emulated") : null), ...scene];
}

const chosen = { coarse: 100, fine: 1, lens: 100 };

function axis(name, label, usual) {
  chosen[name] = usual;
  const input = h("input", { type: "number", step: "any", inputmode: "decimal", "aria-label": `${label}: go to, in µm`, placeholder: "µm" });
  const go = () => act("/api/rig/move", () => ({ axis: [name], to_um: [numeric(input)] }));
  input.addEventListener("keydown", (event) => { if (event.key === "Enter") go(); });
  return h("div", { class: "axis" }, h("span", { class: "axis-name" }, label), input,
    button("Go", go, { "data-needs": "control", "aria-label": `${label}: go` }),
    button("−", () => step(name, -1), { "data-needs": "control", "aria-label": `${label}: a step towards the lens` }),
    choice(STEPS, usual, (value) => { chosen[name] = Number(value); }, { "aria-label": `${label}: step in µm`, title: "Step in µm" }),
    button("+", () => step(name, 1), { "data-needs": "control", "aria-label": `${label}: a step away from the lens` }));
}

function step(name, sign) {
  const info = store.state?.rig.info;
  if (!info) return;
  const to_um = Number((info[name].asked_um + sign * chosen[name]).toFixed(3));
  act("/api/rig/move", { axis: [name], to_um: [to_um] });
}

function details({ info }) {
  if (!info) return h("p", {}, "–");
  const yes = (value) => (value ? "yes" : "no");
  return rows([
    ["board", `${info.board}, firmware ${info.firmware}`], ["protocol", info.protocol], ["boot", `${info.boot}, ${info.reset_cause}`],
    ["datum", number(info.datum_mm, 3, "mm")], ["program", info.program],
    ["home switch", yes(info.home_switch)], ["far switch", yes(info.far_switch)],
    ["emergency stop", info.emergency_stop ? "pressed" : "released"], ["supply", info.supply_low ? "low" : "good"],
    ["bad frames", info.link_bad_frames],
  ]);
}
