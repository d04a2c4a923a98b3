// uPlot asks for the number format of the browser's language. WebKitGTK in the locale C.UTF-8 names a language that does not exist.
try {
  new Intl.NumberFormat(navigator.language);
} catch {
  Object.defineProperty(navigator, "language", { value: "en" });
}
