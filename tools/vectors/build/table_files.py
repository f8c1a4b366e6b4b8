"""TRC, MOT and STO files, to order."""

from __future__ import annotations

SPEC = "Template of tables; The text of tables"
# A rate that is rounded in the times, blanks, a trailing tab, zeros that say nothing.
MARKERS = b"""\
PathFileType\t4\t(X/Y/Z)\tplain.trc\t
DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames
60.00\t60.00\t         5\t2\tmm\t60.00\t1\t         9
Frame#\tTime\tR.Heel\t\t\tL Heel\t\t\t
\t\tX1\tY1\tZ1\tX2\tY2\tZ2\t

185\t3.067000\t596.881230\t1044.682860\t118.560020\t604.533390\t1031.048460\t-141.862350\t
186\t3.083000\t597.012340\t1044.900010\t118.100020\t\t\t\t
187\t3.100000\t597.234560\t1045.123450\t117.654320\t\t\t\t
188\t3.117000\t\t\t\t606.000010\t1032.500010\t-140.500010\t
189\t3.133000\t597.654320\t1045.543210\t116.987650\t606.123450\t1032.765430\t-140.123450\t
"""
TIMES = b"""\
PathFileType\t3\t(X/Y/Z)\todd.trc\r
DataRate\tNumFrames\tUnits\r
50\t4\tm\r
Frame#\tTime\tHead\t\t\r
\t\tX1\tY1\tZ1\r
1\t0.00\t-2.73E-01\t7.46E-02\t-1.57E+00\r
2\t0.02\t-2.74E-01\t7.45E-02\t-1.58E+00\r
7\t0.05\t-2.75E-01\t7.44E-02\t-1.59E+00\r
9\t1e9\t-2.76E-01\tNaN\t-1.60E+00"""
FORCES = b"""\
Coordinates
version=1
nRows=4
nColumns=4
inDegrees=yes

Units are S.I. units (second, meters, Newtons, ...)
Angles are in degrees.

endheader
            time\t     pelvis_tilt\t      pelvis_tx\t         force
      0.00000000\t     10.32995988\t      0.61213494\t             nan
      0.01666667\t     10.07837430\t     -0.61303298\t             nan
      0.03333333\t    -29.10828057\t             nan\t     12.82380037
      0.05000000\t             NaN\t      1.00000000\t     11.53500000
"""
QUATERNIONS = b"""\
DataRate=100.000000
DataType=Quaternion
version=3
OpenSimVersion=4.2
endheader
time\tpelvis_imu\ttibia_r_imu
0\t0.5064886386335554,0.4915562864138964,-0.5355653906346357,0.4636932052300068\t1,0,0,0
0.01\t0.5066763245921503,0.4914209832138792,-0.5354515570241827,0.4637630315530473\t0.8,0,0.6,0
0.02\t0.5068763245921503,0.4912209832138792,-0.5352515570241827,0.4639630315530473\t0.6,-0,0.8,0
"""
