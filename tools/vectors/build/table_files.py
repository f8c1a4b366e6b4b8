"""TRC, MOT, STO and CSV files, to order."""

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
MOTIVE = b"""\
\xef\xbb\xbfFormat Version,1.23,Take Name,"Take 1, again",Take Notes,,\
Capture Frame Rate,120.000000,Export Frame Rate,120.000000,\
Capture Start Time,2023-05-04 10.11.12.131 AM,Capture Start Frame,0,\
Total Frames in Take,4,Total Exported Frames,4,Rotation Type,Quaternion,Length Units,Millimeters,\
Coordinate Space,Global\r
\r
,Type,Bone,Bone,Bone,Bone,Bone,Bone,Bone,Marker,Marker,Marker,Marker\r
,Name,"A, B:Hip","A, B:Hip","A, B:Hip","A, B:Hip","A, B:Hip","A, B:Hip","A, B:Hip",\
Unlabeled 7,Unlabeled 7,Unlabeled 7,Unlabeled 7\r
,ID,"1:1","1:1","1:1","1:1","1:1","1:1","1:1","A0","A0","A0","A0"\r
,Parent,"0:0","0:0","0:0","0:0","0:0","0:0","0:0","0:0","0:0","0:0","0:0"\r
,,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Position,Position,Position,\
Marker Quality\r
Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,X,Y,Z,\r
0,0.000000,0.000035,0.000016,-0.000030,-1.000000,60.002,19.150,76.611,,,,\r
1,0.008333,-0.000008,0.000024,0.000029,-1.000000,60.004,19.161,76.594,9.990,19.158,9.789,0.998\r
2,0.016667,0.000010,0.000020,-0.000004,-1.000000,60.007,19.156,76.598,,,,\r
3,0.025000,,,,,,,,9.991,19.147,9.794,0.998318\r
"""
VICON = b"""\
Devices
200
,,Plate #1 - Force,,,EMG - Left
Frame,Sub Frame,Fx,Fy,Fz,1
,,N,N,N,V
7,0,0,-0.25,612.5,1.5e-05
7,1,1,-0.5,613.25,-2.25e-05
8,0,2,-0.75,614,1.125e-04
8,1,3,-1,615.75,
9,0,4,-1.25,616.5,0
9,1,5,-1.5,617.25,7.5e-06

Model Outputs
100
,,Ann:LKnee,,
Frame,Sub Frame,X,Y,Z
,,deg,deg,deg
7,0,10.5,0.25,-1
8,0,11,0.5,
9,0,11.75,0.75,-1.5

Trajectories
100
,,Ann:LASI,,,Ann:RASI,,
Frame,Sub Frame,X,Y,Z,X,Y,Z
,,mm,mm,mm,mm,mm,mm
7,0,596.881,1044.68,118.56,604.533,1031.05,-141.862
8,0,597.012,1044.9,118.1,,,
9,0,597.235,1045.12,117.654,606,1032.5,-140.5
"""
COLUMNS = b"""\
time_ms;knee angle;force
ms;deg;N
0;1.25;NA
10;-1.5;3.75
20;2.125;4.5"""
EULER = b"""\
Format Version,1.21,Take Name,Take 2,Capture Frame Rate,100.000000,Export Frame Rate,100.000000,\
Total Exported Frames,3,Rotation Type,ZXY,Length Units,Meters,Coordinate Space,Global

,,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body
,,Box,Box,Box,Box,Box,Box,Box
,,"F1","F1","F1","F1","F1","F1","F1"
,,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error
Frame,Time,X,Y,Z,X,Y,Z,
10,0.100000,-0.3125,1.25,90.5,0.060002,0.019150,0.076611,0.000004
11,0.110000,-0.625,1.5,91.25,0.060004,0.019161,0.076594,0.000011
12,0.120000,-0.9375,1.75,92,0.060007,0.019156,,
"""
DEVICES = b"""\
Devices
1000
,,EMG - Left,EMG - Right
Frame,Sub Frame,1,2
,,V,V
1,0,1e-05,-2e-05
1,1,1.5e-05,-2.5e-05
2,0,2e-05,-3e-05
2,1,2.5e-05,-3.5e-05
3,0,3e-05,-4e-05
3,1,3.5e-05,-4.5e-05
"""
ODD_SECTIONS = b"""\
Events
100
Subject,Context,Name,Time (s),Description
Ann,Left,Foot Strike,0.02,-

Trajectories
100
,,Ann:LASI,,
Frame,Sub Frame,X,Y,Z
,,mm,mm,mm
1,0,596.881,1044.68,118.56,
02,0,597.012,1044.9,118.1
3,0,597.235,1045.12,117.654

Devices
200
,,Plate - Force
Frame,Sub Frame,Fz
,,N
1,1,612.5
1,2,613.25\x20
2,1,614
+2,2,615.75
3,1,616.5
3,2,617.25
# the end
"""
