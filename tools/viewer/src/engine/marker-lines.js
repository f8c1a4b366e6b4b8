// Lines between the markers of well-known sets. A set counts where enough of its lines are there.

const FULL_BODY = // Plug-in Gait
  "LFHD-RFHD RFHD-RBHD RBHD-LBHD LBHD-LFHD C7-T10 C7-CLAV CLAV-STRN STRN-T10 C7-LSHO CLAV-LSHO C7-RSHO " +
  "CLAV-RSHO LSHO-LUPA LUPA-LELB LSHO-LELB LELB-LFRM LELB-LWRA LELB-LWRB LWRA-LWRB LWRA-LFIN LWRB-LFIN RSHO-RUPA " +
  "RUPA-RELB RSHO-RELB RELB-RFRM RELB-RWRA RELB-RWRB RWRA-RWRB RWRA-RFIN RWRB-RFIN LASI-RASI LPSI-RPSI LASI-LPSI " +
  "RASI-RPSI LASI-SACR RASI-SACR LASI-LTHI LTHI-LKNE LASI-LKNE LKNE-LTIB LTIB-LANK LKNE-LANK LANK-LHEE LANK-LTOE " +
  "LHEE-LTOE RASI-RTHI RTHI-RKNE RASI-RKNE RKNE-RTIB RTIB-RANK RKNE-RANK RANK-RHEE RANK-RTOE RHEE-RTOE";

const CMU = // the 41 markers of CMU, where they are not those of Plug-in Gait
  "LFWT-RFWT LBWT-RBWT LFWT-LBWT RFWT-RBWT LFWT-LTHI RFWT-RTHI LFWT-LKNE RFWT-RKNE LKNE-LSHN LSHN-LANK " +
  "RKNE-RSHN RSHN-RANK LHEE-LMT5 LMT5-LTOE RHEE-RMT5 RMT5-RTOE LANK-LMT5 RANK-RMT5 LWRA-LTHM LWRB-LTHM " +
  "RWRA-RTHM RWRB-RTHM LFRM-LWRA LFRM-LWRB RFRM-RWRA RFRM-RWRB T10-LBWT T10-RBWT";

const HELEN_HAYES =
  "R.ASIS-L.ASIS R.ASIS-V.SACRAL L.ASIS-V.SACRAL R.ASIS-R.KNEE L.ASIS-L.KNEE R.KNEE-R.ANKLE L.KNEE-L.ANKLE " +
  "R.ANKLE-R.HEEL R.ANKLE-R.TOE R.HEEL-R.TOE L.ANKLE-L.HEEL L.ANKLE-L.TOE L.HEEL-L.TOE R.SHOULDER-L.SHOULDER " +
  "R.SHOULDER-R.ELBOW R.ELBOW-R.WRIST L.SHOULDER-L.ELBOW L.ELBOW-L.WRIST";

const SETS = [FULL_BODY, CMU, HELEN_HAYES].map((text) =>
  text.split(" ").map((line) => line.split("-")),
);
const LEAST = 4; // lines of a set that are there

/**
 * @param {{name: string}[]} points
 * @returns {number[][]} pairs of points, each once
 */
export function markerLines(points) {
  const bySubject = new Map();
  points.forEach(({ name }, index) => {
    const { subject, own } = parted(name);
    if (!bySubject.has(subject)) bySubject.set(subject, new Map());
    const markers = bySubject.get(subject);
    if (!markers.has(own)) markers.set(own, index);
  });
  return [...bySubject.values()].flatMap(linesOf);
}

/** "Kim:LASI" and "KimLASI" are both Kim's. */
function parted(name) {
  const at = name.lastIndexOf(":");
  return {
    subject: name.slice(0, at + 1),
    own: name
      .slice(at + 1)
      .trim()
      .toUpperCase(),
  };
}

function linesOf(markers) {
  const lines = new Map();
  for (const set of SETS) {
    const there = set.filter(([a, b]) => markers.has(a) && markers.has(b));
    if (there.length < LEAST) continue;
    for (const [a, b] of there) lines.set(`${a}-${b}`, [markers.get(a), markers.get(b)]);
  }
  return [...lines.values()];
}
