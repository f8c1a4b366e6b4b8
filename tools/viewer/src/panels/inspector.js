// Details: what is known of the clip, its points, comparison, quality, export.

import { put } from "../ui/dom.js";
import { mountCompare } from "./compare.js";
import { mountExport } from "./export.js";
import { mountInfo } from "./info.js";
import { mountJoints } from "./joints.js";
import { mountQuality } from "./quality.js";
import { tabs } from "../ui/tabs.js";

export function mountInspector(element, page) {
  const { store } = page;
  const list = [
    { id: "info", text: "Info", mount: (panel) => mountInfo(panel, page) },
    { id: "joints", text: "Points", mount: (panel) => mountJoints(panel, page) },
    { id: "compare", text: "Compare", mount: (panel) => mountCompare(panel, page) },
    { id: "quality", text: "Quality", mount: (panel) => mountQuality(panel, page) },
    { id: "export", text: "Export", mount: (panel) => mountExport(panel, page) },
  ];
  const { row, panels, show, shown, setHidden } = tabs("Details", list, (tab) => store.set({ tab }));
  put(element, row, panels);
  store.watch(["tab"], () => store.get("tab") !== shown() && show(store.get("tab")));
  store.watch(["server"], () => {
    const canEncode = Boolean(store.get("server")?.canEncode);
    setHidden("quality", !canEncode);
    if (!canEncode && shown() === "quality") show("info");
  });
  return { show };
}
