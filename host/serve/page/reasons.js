// Reasons for missing depth, with their colours.
/** Why a pixel has no depth, as numbered in reason.png. */
export const REASONS = ["depth measured", "saturated", "too dark", "too little texture", "outside the working range", "seen in one image only", "moved between the exposures", "bad pixel", "model does not fit", "not a finite number", "below the confidence asked for", "outside the range of the correction"];
export const REASON_COLOURS = ["#2f3a40", "#e83030", "#1b2a6b", "#f0b35a", "#8e5bd0", "#63c2d8", "#e06fb0", "#ffffff", "#c8d44a", "#7a7a7a", "#4f9e6f", "#a9734a"];
