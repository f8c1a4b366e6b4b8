// A stub: the panels come from elsewhere.

import { chooseFiles } from "../inputs.js";

export function mountPanels(document, page) {
  const button = document.createElement("button");
  button.textContent = "Open…";
  button.addEventListener("click", () => chooseFiles(page));
  document.getElementById("bar").append(button);
  page.store.watch(["message"], (store) => {
    const message = store.get("message");
    document.getElementById("message").textContent = message?.text ?? "";
  });
}
