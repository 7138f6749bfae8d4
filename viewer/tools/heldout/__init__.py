"""Any scan judged by points withheld from it: ``points`` are the scan as it is shown, ``viewpoints`` where it is judged from,
``command`` what ``pointglass evaluate SCAN`` does.  The figures are :mod:`model.evaluation.heldout`'s."""
