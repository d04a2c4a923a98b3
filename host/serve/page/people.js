// Guides about people: their shadow by the sun, and what they do.
import { act, call, failure, get, on, onJob, store } from "./link.js";
import { h, button, field, keep, notice, number, numeric, panel, rows } from "./ui.js";
import * as draw from "./guide-pictures.js";

const LAST = 240;
/** Largest video that the server accepts. */
const VIDEO_MAX_BYTES = 256 * 2 ** 20;

/** A choice of the videos that were sent, with a way to send one. */
function videos() {
  const chosen = h("select", { "aria-label": "Video" });
  const file = h("input", { type: "file", accept: "video/*,.y4m", "data-needs": "computation", "aria-label": "Video file to send" });
  const said = h("p", { class: "dim", "aria-live": "polite" });
  let newest = 0;
  async function shown(sent = "") {
    const asked = ++newest;
    try {
      const { videos: names } = await get("/api/people");
      // An answer that is overtaken by a later question is old.
      if (asked !== newest) return;
      const present = sent || chosen.value;
      chosen.replaceChildren(...names.map((name) => h("option", { value: name, selected: name === present }, name)));
      if (!names.length) chosen.append(h("option", { value: "" }, "none sent yet"));
    } catch (error) {
      notice(error.message, "error", error.hint);
    }
  }
  file.addEventListener("change", async () => {
    const [video] = file.files;
    if (!video) return;
    said.textContent = `sending ${video.name} …`;
    try {
      if (video.size > VIDEO_MAX_BYTES) throw new Error(`${video.name} has ${number(video.size / 2 ** 20, 0)} MB: expected 256 MB at most`);
      const name = free(video.name, (await get("/api/people")).videos);
      const answer = await fetch(`/api/people/videos/${encodeURIComponent(name)}`, { method: "PUT", body: video, headers: { "x-farnear-client": store.client?.secret ?? "" } });
      if (!answer.ok) throw await failure(answer);
      await shown(name);
      said.textContent = `${name} is there`;
    } catch (error) {
      said.textContent = "";
      notice(error.message, "error", error.hint);
    } finally {
      file.value = ""; // the same file can be chosen again
    }
  });
  return { parts: [field("Video", chosen), field("Send one", file), said], shown, name: () => chosen.value };
}

/** A name for a file, of letters and digits, that none of the others has. The server accepts 100 bytes.
 * @param {string} name @param {string[]} others */
function free(name, others) {
  const plain = name.normalize("NFC").replace(/[^\p{L}\p{N}._-]+/gu, "-").replace(/^\.+/, "");
  const [, stem, ending] = /^(.*?)(\.[A-Za-z0-9]{1,8})?$/.exec(plain) ?? ["", plain, ""];
  const short = [...stem];
  while (new TextEncoder().encode(short.join("")).length > 80) short.pop();
  for (let count = 1; ; count++) {
    const found = `${short.join("") || "video"}${count > 1 ? `-${count}` : ""}${ending ?? ""}`;
    if (!others.includes(found)) return found;
  }
}

/** Activity of a person: the streaming answer next to the picture. */
export function activity() {
  const video = videos();
  const canvas = h("canvas", { class: "person", role: "img", "aria-label": "Picture with the person marked" });
  const answer = h("output", { class: "big", "aria-live": "polite" }, "–");
  const details = h("div", {});
  const strip = h("canvas", { class: "strip", role: "img", "aria-label": "Answers over the last frames", width: LAST, height: 24 });
  const known = h("p", { class: "dim" });
  const past = [];
  // The answer for the whole stays: pictures that were on the way may come after it.
  let answered = false;
  const forget = () => {
    past.length = 0;
    answered = false;
    answer.textContent = "–";
    details.replaceChildren();
    delete details.dataset.key;
  };
  const start = (wish) => {
    forget(); // a job that fails at once is never seen to run
    act("/api/people/recognise", wish);
  };
  onJob("recognise", ({ phase, result }) => {
    if (phase === "running") forget();
    if (phase !== "done" || !result) return;
    answered = true;
    const best = result.probabilities.toSorted((a, b) => b.probability - a.probability).slice(0, 3);
    tell({ ...result, best }, `of all ${result.frames} frames`);
  });
  const tell = (found, of) => {
    const [first] = found.best ?? [];
    const likely = first?.probability;
    if (found.activity || likely == null) answer.replaceChildren(found.activity ?? "unknown", h("small", {}, ` ${number(100 * found.confidence, 0)} % ${of}`));
    else answer.replaceChildren(`probably ${first.activity} (${number(100 * likely, 0)} %), below the threshold`, h("small", {}, ` ${of}`));
    keep(details, [found.best, found.flags], () => [rows(found.best.map(({ activity: name, probability }) => [name, h("meter", { min: 0, max: 1, value: probability, "aria-label": name }, `${number(100 * probability, 0)} %`)])),
      found.flags?.length ? h("p", { class: "dim" }, found.flags.join(", ")) : ""]);
  };
  on("person", ({ width, height, answer: found }, pixels) => {
    show(canvas, pixels, width, height);
    if (!answered) tell(found, `at frame ${found.frame}`);
    past.push(found.activity);
    if (past.length > LAST) past.shift();
    stripes(strip, past);
  });
  const element = h("div", { class: "guide-body" },
    h("section", { class: "panel guide-step" }, h("div", { class: "guide-picture" }, draw.person()), h("div", { class: "guide-words" }, h("h2", {}, "Activity of a person"),
      h("p", {}, "A fixed camera and one person who moves. The first frames teach the background. Stop ends it."), video.parts, known,
      h("div", { class: "buttons" }, button("Recognise the video", () => start({ video: video.name() }), { class: "primary", "data-needs": "computation" }), button("Watch the camera", () => start({}), { "data-needs": "rig" })))),
    panel("Answer", h("div", { class: "person-answer" }, canvas, h("div", {}, answer, strip, details))));
  const shown = async () => {
    await video.shown();
    const { activities } = await get("/api/people").catch(() => ({ activities: [] }));
    known.textContent = activities.length ? `Knows ${activities.length} activities: ${activities.join(", ")}.` : "";
  };
  return { element, shown };
}

/** The picture in grey, the person in the page's accent. */
function show(canvas, pixels, width, height) {
  canvas.width = width;
  canvas.height = height;
  const image = new ImageData(width, height);
  const count = width * height;
  for (let at = 0; at < count; at++) {
    const [grey, person] = [pixels[at], pixels[count + at]];
    image.data.set(person ? [grey * 0.4, 90 + grey * 0.6, 120 + grey * 0.5, 255] : [grey, grey, grey, 255], 4 * at);
  }
  canvas.getContext("2d").putImageData(image, 0, 0);
}

/** A stripe of colour for each answer, and how often each was given. */
function stripes(canvas, past) {
  const context = canvas.getContext("2d");
  context.clearRect(0, 0, canvas.width, canvas.height);
  /** @type {Map<string, number>} */
  const tally = new Map();
  for (const name of past) tally.set(name ?? "unknown", (tally.get(name ?? "unknown") ?? 0) + 1);
  canvas.setAttribute("aria-label", `Answers at the last ${past.length} frames shown: ${[...tally].map(([name, count]) => `${name} ${count}`).join(", ")}`);
  past.forEach((name, at) => {
    let hash = 7;
    for (const letter of name ?? "") hash = (hash * 31 + letter.charCodeAt(0)) % 360;
    context.fillStyle = name ? `hsl(${hash} 55% 50%)` : "#8886";
    context.fillRect(at, 0, 1, canvas.height);
  });
}

/** The shadow of a person by where the sun stands. */
export function shadow() {
  const video = videos();
  const input = (value, about) => h("input", { type: "number", step: "any", value, title: about });
  const inputs = { latitude: input(52.95), longitude: input(-1.18), height: input(1.2), azimuth: input(0, "anticlockwise from north"), pitch: input(5, "downwards"), focal: input(8), pixel: input(6) };
  const now = new Date(Date.now() - new Date().getTimezoneOffset() * 60_000).toISOString().slice(0, 16);
  const time = h("input", { type: "datetime-local", value: now });
  const picture = h("div", { class: "guide-picture wide" }, draw.sun(30, 0, 1.7));
  const facts = h("div", { "aria-live": "polite" });
  const results = h("div", { "aria-live": "polite" });
  const sunlight = () => {
    if (!time.value) throw new Error(`Time: expected a date and a time, the field is ${time.validity.badInput ? "incomplete" : "empty"}`);
    return { lat: numeric(inputs.latitude), lon: numeric(inputs.longitude), time: new Date(time.value).toISOString() };
  };
  let newest = 0;
  async function shown() {
    const asked = ++newest;
    try {
      const light = sunlight();
      const found = await call("POST", "/api/people/sun", light);
      // An answer that is overtaken by a later question is old.
      if (asked !== newest) return;
      const { elevation_deg, azimuth_deg } = found.figures;
      picture.replaceChildren(draw.sun(elevation_deg, found.direction_deg, found.length_per_height ?? NaN));
      facts.replaceChildren(rows([["time in UTC", light.time.slice(0, 16).replace("T", " ")], ["sun above the horizon", `${number(elevation_deg, 2)}°`], ["sun from north", `${number(azimuth_deg, 2)}°`],
        ["shadow falls to", `${number(found.direction_deg, 1)}°`], ["shadow's length", found.length_per_height == null ? "no shadow" : `${number(found.length_per_height, 2)} × height`]]));
    } catch (error) {
      if (asked !== newest) return;
      picture.replaceChildren();
      facts.replaceChildren(h("p", { class: "bad" }, error.message));
    }
  }
  let waiting = 0;
  for (const control of [time, inputs.latitude, inputs.longitude]) control.addEventListener("input", () => { clearTimeout(waiting); waiting = setTimeout(shown, 150); });
  const start = () => act("/api/people/shadow", () => {
    const camera = { height_m: numeric(inputs.height), azimuth_deg: numeric(inputs.azimuth), pitch_deg: numeric(inputs.pitch), focal_length_mm: numeric(inputs.focal), pixel_um: numeric(inputs.pixel) };
    return { video: video.name(), sun: sunlight(), camera };
  });
  onJob("shadow", ({ phase, result: found }) => {
    if (phase !== "done") return;
    const mask = (folder, file) => h("img", { src: `/api/people/shadows/${found.shadow}/${folder}/${file}`, alt: `${file}, ${folder.replace("-", " ")}`, loading: "lazy" });
    results.replaceChildren(rows([["frames", found.frames], ["cut", found.cut], ["doubtful", found.flagged], ["removed, mean", found.removed_percent == null ? "–" : `${number(found.removed_percent, 1)} %`]]),
      h("div", { class: "masks" }, found.samples.map((file) => h("figure", {}, mask("with-shadow", file), mask("without-shadow", file), h("figcaption", { class: "dim" }, file)))));
  });
  const element = h("div", { class: "guide-body" },
    h("section", { class: "panel guide-step" }, picture, h("div", { class: "guide-words" }, h("h2", {}, "1. Where and when"),
      field("Latitude", inputs.latitude, "°"), field("Longitude", inputs.longitude, "°"), field("Time", time), facts)),
    h("section", { class: "panel guide-step" }, h("div", { class: "guide-picture" }, draw.camera()), h("div", { class: "guide-words" }, h("h2", {}, "2. How the camera stood"),
      field("Height", inputs.height, "m"), field("Looks to", inputs.azimuth, "°"), field("Down by", inputs.pitch, "°"), field("Focal length", inputs.focal, "mm"), field("Pixel", inputs.pixel, "µm"),
      h("p", { class: "dim" }, "Looks to: anticlockwise from north."))),
    h("section", { class: "panel guide-step" }, h("div", { class: "guide-picture" }, draw.person()), h("div", { class: "guide-words" }, h("h2", {}, "3. The video"), video.parts,
      h("div", { class: "buttons" }, button("Take the shadow off", start, { class: "primary", "data-needs": "client" })))),
    panel("Masks with and without shadow", results));
  return { element, shown: () => { video.shown(); shown(); } };
}
