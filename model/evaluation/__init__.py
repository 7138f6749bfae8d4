"""Evaluation of picture quality: reconstruction methods compared on rooms with ground truth, at several point densities.

- ``room_scores``: runs the evaluation of a room.
- ``methods``: the compared methods; ``outside`` and ``open3d_points``: those of others; ``own_methods``: your own.
- ``figures``: metrics of one picture against the truth; ``metrics`` and ``flip`` compute some of them.
- ``worse``: counts the views in which a network's picture is worse than the filled picture.
- ``heldout``: evaluates any scan at points withheld from it.
- ``flicker``: compares neighbouring pictures along a camera path.
- ``paper_table``: the table of the paper; ``paper_methods``: its methods; ``paper_report``: as text, CSV and LaTeX.
- ``made_with``: version, seed and weights, for every JSON.
- ``report``: writes the results; ``command``: the command line.
"""
