// What stands around the picture: bar, clips, details, messages.

import { chooseFiles } from "../inputs.js";
import { tellError, watchErrors } from "./actions.js";
import { mountBar } from "./bar.js";
import { mountClips } from "./clips/clips.js";
import { mountHelp } from "./help.js";
import { mountInspector } from "./inspector.js";
import { mountKeys } from "./keys.js";
import { mountLayout } from "./layout.js";
import { mountMessage } from "./message.js";
import { mountTheme } from "./theme.js";

/** Fills the parts of the document that README.md names. */
export function mountPanels(document, page) {
  const theme = mountTheme(document, page);
  const layout = mountLayout(document, page);
  const help = mountHelp(document);
  const openFiles = async () => {
    try {
      await chooseFiles(page);
    } catch (error) {
      tellError(page.store, error);
    }
  };
  mountBar(document.getElementById("bar"), page, { openFiles, layout, theme, help });
  mountClips(document.getElementById("clips"), page);
  mountInspector(document.getElementById("inspector"), page);
  mountMessage(document.getElementById("message"), page);
  mountKeys(document, { layout, help });
  watchErrors(page);
}
