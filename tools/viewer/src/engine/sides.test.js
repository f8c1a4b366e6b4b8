import assert from "node:assert/strict";
import { test } from "node:test";
import { sideOf } from "./sides.js";

const NAMES = {
  left:
    "lfemur lhipjoint lclavicle LeftUpLeg LeftHandIndex1 mixamorig:LeftArm thigh_L hand.L L_Knee LHip Bip01_L_Thigh LASI LFHD LWRA " +
    "Kim:LTOE lCollar lThumb1 LeftToeBase left_wrist l_ankle LSHO LMT5 LeftEye Leftfoot",
  right:
    "rtibia RightFoot thigh.R R_Ankle RASI RBHD rShldr rButtock mixamorig:RightForeArm RTHI bip_R_hand right",
  center:
    "root Hips Spine LowerBack lowerneck upperback head neck1 C7 T10 STRN CLAV Reference larynx ribs pelvis Rig RootJoint Ribcage Loc1 lumbar",
};

for (const [side, names] of Object.entries(NAMES)) {
  test(`${side} by name`, () => {
    for (const name of names.split(" ")) {
      const wanted = name === "right" ? "right" : side;
      assert.equal(sideOf(name), wanted, name);
    }
  });
}
