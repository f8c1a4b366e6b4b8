// What the page says: one line that goes after a while, or stays where it is a fault.

import { button, fill, make } from "../ui/dom.js";

const STAYS_MS = 6000;

export function mountMessage(element, { store }) {
  let timer = 0;
  const close = () => store.set({ message: null });
  store.watch(["message"], () => {
    clearTimeout(timer);
    const message = store.get("message");
    element.hidden = !message;
    element.classList.toggle("fault", Boolean(message?.isFault));
    if (!message) return fill(element);
    fill(
      element,
      make("span", {}, message.text),
      button({ label: "Close the message", icon: "close", class: "small", onClick: close }),
    );
    if (!message.isFault) timer = setTimeout(close, STAYS_MS);
  });
}
