"""Evaluation of any scan at points withheld from it; the metrics are those of :mod:`model.evaluation.heldout`.

``scan_points`` reads the points, ``judged_viewpoints`` chooses the cameras, ``evaluate_scan`` is ``pointglass evaluate SCAN``.
"""
