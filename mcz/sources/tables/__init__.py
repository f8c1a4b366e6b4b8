"""Tables of numbers as text: TRC, STO and MOT, CSV of Motive, Vicon and plain columns.

``rows`` splits rows into cells, ``signals`` makes signals of columns, ``layout`` and ``notes``
have all other bytes, ``restore`` joins both.
"""
