// The tables of the annex that the models of entropy coding start with ("start tables").

import { annexJson } from "./annex.js";
import { Model } from "./entropy.js";

const parsed = new WeakMap();

/**
 * The models of one annex file, of its `sets` or of the one that it is, made once. Nobody learns
 * in them: see {@link restart}.
 *
 * @param {string} name such as "wavelet_start.json"
 * @returns {Model[]} one of each set
 * @throws {import("./errors.js").Unsupported} where the annex is not there
 */
export function startModels(name) {
  const document = annexJson(name);
  let models = parsed.get(document);
  if (models === undefined) {
    models = (document.sets ?? [document]).map((table) => Model.from(table));
    parsed.set(document, models);
  }
  return models;
}

/**
 * Takes a model that has learned back to where a start table is, without new memory.
 *
 * @param {Model} model
 * @param {Model} start of the same size
 */
export function restart(model, start) {
  model.probabilities.set(start.probabilities);
  model.counts.set(start.counts);
  model.weights.set(start.weights);
}
