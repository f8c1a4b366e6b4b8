"""A decoder with one rule of SPEC.md broken: what proves that the vectors notice.

``python -m tests.broken ID`` is ``python -m mcz.cli.conformance`` in which the rule with that
requirement id does not hold, so that the runner can be pointed at it. Marks in the code say where
a rule stands (``marks``); a few operators say how such a place may be broken (``changes``); a
variant is one of them at one place, or at all places of the rule (``variants``). ``by_hand`` has
the rules that are not one statement. ``found.txt`` holds the variants that vectors notice; it is
made by ``python -m tests.broken --find``.
"""
