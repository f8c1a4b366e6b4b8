// Left, right or center, by the name of a joint or a marker.

const SIDES = { l: "left", left: "left", lft: "left", r: "right", right: "right", rgt: "right" };

/** What follows an l or r that is written together with it. */
const PARTS = (
  "acr ankle ank ajc arm asi asis bak back bhd bicep breast brow bt bwt buttock calf cheek clavicle clav " +
  "collar ear ejc elb elbow eye fa faradius fbt fep feo femur fhd fin finger fingers fjc foot forearm fore " +
  "forehead frm frh ft fwt gt hand head heel hee hel hip hipjoint hjc hnd hum humerus iel iham iwr kjc kne " +
  "knee knee1 leg le lm lfhd me mkne mank mm mt mt1 mt5 mcp oel ofr owr palm pelvis pinky psi psis ra radius " +
  "rstbeef sae sho shoe shoulder shank shin shld shn shldr sjc ths thi thigh thm thmb thumb tib tibia tio toe " +
  "toes uarm upa uparm upleg uplo upperarm wjc wr wra wrb wri wrist wrists xfhd"
).split(" ");
const TOGETHER = new RegExp(`^([lr])(?:${PARTS.join("|")})(?:\\d.*)?$`);

/** The words of a name, in small letters: "mixamorig:LeftUpLeg1" gives left, up, leg, 1. */
function wordsOf(name) {
  return name
    .slice(name.lastIndexOf(":") + 1)
    .replace(/([a-z])([A-Z])|([A-Z])(?=[A-Z][a-z])/g, "$1$3 $2")
    .split(/[^A-Za-z0-9]+|(?<=\D)(?=\d)|(?<=\d)(?=\D)/)
    .filter(Boolean)
    .map((word) => word.toLowerCase());
}

/**
 * The side of a point.
 *
 * @param {string} name of a joint or marker, with its subject before a colon or without
 * @returns {"left" | "right" | "center"}
 */
export function sideOf(name) {
  const words = wordsOf(name);
  for (const word of words) {
    if (Object.hasOwn(SIDES, word) && words.length > 1) return SIDES[word];
  }
  for (const word of words) {
    const [, letter] = word.match(TOGETHER) ?? word.match(/^(left|right)/) ?? [];
    if (letter) return SIDES[letter];
  }
  return "center";
}
