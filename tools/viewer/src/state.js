// The values of the store when the page opens.

/** See README.md, "The store". */
export function initial() {
  return {
    files: [],
    shown: null,
    loading: null,
    compared: null,
    frame: 0,
    playing: false,
    speed: 1,
    loop: true,
    layout: "overlay",
    colors: "sides",
    selection: [],
    trails: false,
    contacts: false,
    names: false,
    neighbors: false,
    follow: false,
    up: null,
    view: { name: "three-quarter" },
    errors: null,
    message: null,
    server: null,
    theme: null,
    curves: [],
    panels: {},
    tab: "info",
    errorsShare: null,
    diffs: [],
  };
}
