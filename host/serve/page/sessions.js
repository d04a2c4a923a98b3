// The captures of the session: pictures, notes and downloads.
import { act, ended, get, on, store } from "./link.js";
import { ask, h, allow, button, choice, notice, number, refocus, when } from "./ui.js";

/** Makes the view. `open(name)` shows a capture's depth. */
export function make(host, open) {
  const search = h("input", { type: "search", placeholder: "Words of optics, scene, note …", "aria-label": "Search captures" });
  const count = h("span", { class: "dim" });
  const list = h("ul", { class: "captures" });
  host.append(h("div", { class: "toolbar" }, search, count), list);
  const kinds = choice([["", "all kinds"], ["pair", "pairs"], ["sequence", "stills and stacks"], ["depth", "with depth"], ["rated", "rated"]], "", () => refresh(), { "aria-label": "Show" });
  /** Depth of all shown pairs that have none, for a series; ends where one fails or is stopped. */
  const measure = button("Compute depth of all", async () => {
    const pairs = shown.filter((capture) => capture.kind === "pair" && !capture.has_depth && !capture.broken).reverse();
    if (!pairs.length) notice("No pair without a depth is shown here.");
    allow(measure, false);
    for (const [at, { name }] of pairs.entries()) {
      measure.textContent = `Depth ${at + 1} of ${pairs.length}`;
      const begun = await act(`/api/captures/${encodeURIComponent(name)}/depth`, { uncertainty: "estimated" });
      if (!begun || (await ended("computation", begun.job)).phase !== "done") break;
    }
    allow(measure, true);
    measure.textContent = "Compute depth of all";
    refresh();
  }, { title: "Of the pairs shown here that have none" });
  search.after(kinds, measure);
  const wanted = (capture) => !kinds.value || kinds.value === capture.kind || (kinds.value === "depth" && capture.has_depth) || (kinds.value === "rated" && capture.note.rating > 0);
  let waiting = 0;
  let shown = [];
  let newest = 0;
  search.addEventListener("input", () => { clearTimeout(waiting); waiting = setTimeout(() => refresh(), 200); });

  /** @param {string | number} [focus] The capture, or the place in the list, that gets the focus. */
  async function refresh(focus) {
    const asked = ++newest;
    try {
      const { captures } = await get(`/api/captures?search=${encodeURIComponent(search.value)}`);
      if (asked !== newest) return; // a later search is on the way
      count.textContent = captures.length === 1 ? "1 capture" : `${captures.length} captures`;
      shown = captures.filter(wanted).sort((a, b) => b.written_unix_s - a.written_unix_s || b.name.localeCompare(a.name));
      list.replaceChildren(...shown.map((capture, at) => card(capture, at, open, refresh)));
      const at = typeof focus === "string" ? shown.findIndex(({ name }) => name === focus) : Math.min(focus ?? -1, shown.length - 1);
      if (focus !== undefined) refocus(list.children[at]?.querySelector("button") ?? search);
      if (!captures.length) list.append(h("li", { class: "empty" }, search.value ? "Nothing holds all of these words." : "Nothing captured yet."));
    } catch (error) {
      notice(error.message, "error", error.hint);
    }
  }
  let seen = -1;
  on("state", (state) => {
    if (state.captures === seen || host.hidden || list.contains(document.activeElement)) return;
    seen = state.captures;
    refresh();
  });
  return { shown: () => { seen = store.state?.captures ?? -1; refresh(); } };
}

/** `changed` is called after a capture was renamed or deleted, with its new name or its place. */
function card(capture, at, open, changed) {
  const file = capture.has_depth ? "view.png" : capture.images[0];
  // A browser shows a picture that it has again, unless the address changes.
  const picture = `files/${encodeURIComponent(file)}?${store.state?.captures ?? 0}`;
  const path = `/api/captures/${encodeURIComponent(capture.name)}`;
  const focus = capture.optics?.focus;
  const kind = capture.kind === "pair" ? "pair" : capture.images.length === 1 ? "still" : "stack";
  const facts = [kind, `${capture.width} × ${capture.height}`, `${capture.exposure_us} µs`, focus && `far ${number(focus.far_mm, 0)} mm`, capture.scene && `scene ${capture.scene}`, capture.time ? when(Date.parse(capture.time)) : capture.written_unix_s && when(1000 * capture.written_unix_s)];
  return h("li", { class: "capture-card" },
    h("button", { type: "button", class: "thumbnail", onclick: () => open(capture.name), "aria-label": `Open ${capture.name}` },
      capture.broken ? h("span", { class: "bad" }, "broken") : h("img", { src: `${path}/${picture}`, alt: "", loading: "lazy" })),
    h("div", { class: "capture-words" }, h("h3", {}, capture.name), h("p", { class: "dim" }, capture.broken ?? facts.filter(Boolean).join(" · ")),
      stars(capture), note(capture)),
    h("div", { class: "buttons" }, h("a", { class: "button", href: `${path}/report.html`, target: "_blank", rel: "noopener" }, "Report"),
      h("a", { class: "button", href: `${path}/zip`, download: `${capture.name}.zip` }, "ZIP"),
      button("Rename", async () => {
        const name = await ask(`New name of ${capture.name}`, { text: true, yes: "Rename" });
        if (name && (await act(`${path}/rename`, { name: name.trim() }))) changed(name.trim());
      }), button("Delete", async () => {
        if ((await ask(`Delete ${capture.name} with all of its files?`, { yes: "Delete", no: "Keep" })) !== null && (await act(path, {}, "DELETE"))) changed(at);
      }, { class: "danger" })));
}

function stars(capture) {
  const row = h("div", { class: "stars", role: "group", "aria-label": `Rating of ${capture.name}` });
  const fill = () => [...row.children].forEach((star, at) => star.setAttribute("aria-pressed", at < capture.note.rating));
  for (let rating = 1; rating <= 5; rating++) {
    row.append(button("★", () => {
      capture.note.rating = capture.note.rating === rating ? 0 : rating;
      fill();
      save(capture);
    }, { "aria-label": `${rating} of 5` }));
  }
  fill();
  return row;
}

function note(capture) {
  const text = h("textarea", { rows: 1, placeholder: "Note", "aria-label": `Note about ${capture.name}` });
  text.value = capture.note.text;
  text.addEventListener("change", () => { capture.note.text = text.value; save(capture); });
  return text;
}

const save = (capture) => act(`/api/captures/${encodeURIComponent(capture.name)}/note`, capture.note, "PUT");
