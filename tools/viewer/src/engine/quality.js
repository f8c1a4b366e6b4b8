// SPEC.md, "QUAL": the quality record for people, with the names of joints in place of their indices.

const LISTS = ["cut-joints", "edit-joints"];
const JOINTS = ["shell_max_joint", "slide_max_joint"];
const POINT = "max_position_error_point";
const WORDS = ["param.contacts", "param.lossless", "param.quality"]; // joints or groups, and numbers
const REACHED = "quality_reached."; // of a joint or a group
const BEFORE = /^(uncut_|unedited_|edit_)*/; // of keys
const INDEX = /^(0|[1-9][0-9]*)(?=$|[:=])/;

/**
 * @param {{key: string, value: string}[]} entries as a file has them
 * @param {{joints: {name: string}[], points: {name: string}[]}} clip
 * @returns {{key: string, value: string}[]} an index beyond all stays
 */
export function namedQuality(entries, { joints, points }) {
  const named = (text, of) => text.replace(INDEX, (index) => of[index]?.name ?? index);
  return entries.map(({ key, value }) => {
    const [before] = key.match(BEFORE);
    const name = key.slice(before.length);
    if (name.startsWith(REACHED)) {
      return { key: before + REACHED + named(name.slice(REACHED.length), joints), value };
    }
    if (name === POINT) return { key, value: named(value, points) };
    if (![...LISTS, ...JOINTS, ...WORDS].includes(name)) return { key, value };
    const parts = value.split(",").map((part) => named(part, joints));
    return { key, value: parts.join(",") };
  });
}
