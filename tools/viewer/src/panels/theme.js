// Light, dark, or as the system has it. Style reads `data-theme`, and pictures `theme` of the store.

import { remember, remembered } from "../ui/settings.js";

export const THEMES = [
  ["system", "System"],
  ["light", "Light"],
  ["dark", "Dark"],
];

/** Sets the theme that was remembered; gives a function that sets another. */
export function mountTheme(document, { store }) {
  const dark = matchMedia("(prefers-color-scheme: dark)");
  let wanted = remembered("theme", "system");
  const apply = () => {
    const theme = wanted === "system" ? (dark.matches ? "dark" : "light") : wanted;
    document.documentElement.dataset.theme = theme;
    store.set({ theme });
  };
  dark.addEventListener("change", apply);
  apply();
  return {
    wanted: () => wanted,
    set(theme) {
      wanted = theme;
      remember("theme", theme);
      apply();
    },
  };
}
