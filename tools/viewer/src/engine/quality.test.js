import assert from "node:assert/strict";
import { test } from "node:test";
import { namedQuality } from "./quality.js";

const CLIP = {
  joints: [{ name: "hips" }, { name: "4" }, { name: "foot" }],
  points: [{ name: "hips" }, { name: "foot end" }],
};

for (const [key, value, wantedKey, wanted] of [
  ["edit-joints", "2,0,3", "edit-joints", "foot,hips,3"],
  ["uncut_max_position_error_point", "1", "uncut_max_position_error_point", "foot end"],
  ["edit_shell_max_joint", "1", "edit_shell_max_joint", "4"],
  ["param.contacts", "2:160+52,0", "param.contacts", "foot:160+52,hips"],
  ["param.quality", "feet=0.1cm,2=0.05cm", "param.quality", "feet=0.1cm,foot=0.05cm"],
  ["quality_reached.2", "0.04", "quality_reached.foot", "0.04"],
  ["quality_reached.feet", "0.04", "quality_reached.feet", "0.04"],
  ["points", "1", "points", "1"],
]) {
  test(`${key} ${value}`, () => {
    assert.deepEqual(namedQuality([{ key, value }], CLIP), [{ key: wantedKey, value: wanted }]);
  });
}
