"""How sure a number is: intervals, paired tests and ranks. Functions from arrays to numbers; SciPy does the work.

Holm's correction is the one thing that SciPy lacks; it is two lines. scikit-posthocs has it, and would bring
statsmodels, pandas, seaborn and matplotlib.
"""
