// What is asked of `mcz view`, where it serves the page.

import { fileOf } from "./actions.js";

/** The answer to a POST: JSON, or bytes where the server sends bytes. Throws what the server says. */
export async function post(path, body, { signal } = {}) {
  const response = await fetch(path, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(body),
    signal,
  });
  const isJson = /json/.test(response.headers.get("Content-Type") ?? "");
  if (!response.ok) throw new Error(await reason(response, isJson));
  return isJson ? response.json() : response.arrayBuffer();
}

async function reason(response, isJson) {
  try {
    const { error } = isJson ? await response.json() : { error: await response.text() };
    const text = error?.message ?? error;
    if (text) return String(text).trim().slice(0, 1000);
  } catch {
    // What it says is not what it is.
  }
  return `The server answers ${response.status}.`;
}

/** `{ url, clip }` of a clip that the server has, or null. */
export function served(store, clip) {
  const url = clip && (fileOf(store, clip)?.url ?? clip.servedUrl);
  return url ? { url, clip: clip.index } : null;
}
