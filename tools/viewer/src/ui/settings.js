// What the page remembers of its user's wishes, where the browser lets it.

const KEY = "mcz viewer";

function read() {
  try {
    const found = JSON.parse(localStorage.getItem(KEY));
    return found !== null && typeof found === "object" ? found : {};
  } catch {
    return {}; // a page from a disk may have no storage
  }
}

export const remembered = (name, otherwise) => read()[name] ?? otherwise;

export function remember(name, value) {
  try {
    localStorage.setItem(KEY, JSON.stringify({ ...read(), [name]: value }));
  } catch {
    // It is asked for again next time.
  }
}
