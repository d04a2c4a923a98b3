// Sends the token; the answer is a cookie that this page cannot read.
const form = /** @type {HTMLFormElement} */ (document.getElementById("login"));
form.addEventListener("submit", async (event) => {
  event.preventDefault();
  const token = /** @type {HTMLInputElement} */ (document.getElementById("token")).value.trim();
  const answer = await fetch("/login", {
    method: "POST",
    headers: { "content-type": "application/json" },
    body: JSON.stringify({ token }),
  });
  if (answer.ok) location.reload();
  else /** @type {HTMLElement} */ (document.getElementById("wrong")).textContent = "This is not the token.";
});
