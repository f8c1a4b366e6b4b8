"""Tables of numbers as text: TRC, STO and MOT, CSV of Motive, Vicon and plain columns.

``rows`` splits rows into cells, ``signals`` makes signals of columns, ``layout`` has
all other bytes, ``restore`` joins both. A module for each format reads it.
"""
