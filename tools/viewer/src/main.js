// The page: one store, one engine that decodes, and parts that watch the store.

import { Engine } from "./engine/engine.js";
import { openFirst } from "./inputs.js";
import { mountPanels } from "./panels/panels.js";
import { mountStage } from "./stage/stage.js";
import { initial } from "./state.js";
import { Store } from "./store.js";
import { mountTimeline } from "./timeline/timeline.js";

const store = new Store(initial());
const engine = new Engine();
const page = { store, engine };
globalThis.mczViewer = page; // for tests, and for the curious

page.stage = mountStage(document.getElementById("stage"), page);
mountTimeline(document.getElementById("timeline"), page);
mountPanels(document, page);
await openFirst(page);
