// Work in small pieces, between which other messages are answered.

/** Resolves when messages that have come meanwhile were begun. */
export function nextTurn() {
  return new Promise((resolve) => later(resolve));
}

/** In a worker by a message, which waits for nothing but the messages before it. */
const later = globalThis.setImmediate ?? byMessage();

function byMessage() {
  const channel = new MessageChannel();
  const waiting = [];
  channel.port1.onmessage = () => waiting.shift()();
  return (resolve) => {
    waiting.push(resolve);
    channel.port2.postMessage(null);
  };
}
