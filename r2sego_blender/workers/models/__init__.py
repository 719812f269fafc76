"""The workers of learned models: each file is run in the Python of its model's own environment.

May use ``protocol.serving`` and the model's published interface, of Python 3.9 or later, and nothing else of this
library. Begin with ``loading``; what goes in and what comes out of each model its estimator says
(``geometry.estimators``), in whose conventions these files leave it.
"""
