// Sends the token; the answer is a cookie that this page cannot read.
const form = /** @type {HTMLFormElement} */ (document.getElementById("login"));
form.addEventListener("submit", async (event) => {
  event.preventDefault();
  const token = /** @type {HTMLInputElement} */ (document.getElementById("token")).value.trim();
  const wrong = /** @type {HTMLElement} */ (document.getElementById("wrong"));
  try {
    const answer = await fetch("/login", {
      method: "POST",
      headers: { "content-type": "application/json" },
      body: JSON.stringify({ token }),
    });
    if (answer.ok) return location.reload();
    // A right token is refused, too, while a wrong one waits.
    wrong.textContent = (await answer.json().catch(() => ({}))).error ?? `failed (${answer.status})`;
  } catch {
    wrong.textContent = "farnear does not answer; does it still run?";
  }
});
