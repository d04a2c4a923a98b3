// Reasons for missing depth, with colours that people with a colour-vision deficiency tell apart, too.
/** Why a pixel has no depth, as numbered in reason.png. */
export const REASONS = ["depth measured", "saturated", "too dark", "too little texture", "outside the working range", "seen in one image only", "moved between the exposures", "bad pixel", "model does not fit", "not a finite number", "below the confidence asked for", "outside the range of the correction"];
export const REASON_COLOURS = ["#2f3a40", "#e8000d", "#400d5b", "#fbe076", "#8553f3", "#8ca8eb", "#f58eb2", "#ffffff", "#b0ea00", "#b24d9c", "#567d62", "#b49654"];
