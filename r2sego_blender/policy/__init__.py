"""From the refined scene to a policy: what the paper trains in it (Sec. "Policy Training").

A bundle becomes Gymnasium environments, in which a privileged teacher labels what a student then does from head
images alone. Uses ``splats`` and ``robot`` for what is seen and what moves, and ``bundle``, ``config`` and ``core``;
needs the packages of the extra ``policy``. Begin with ``environment``, then ``teacher``, ``student`` and ``dagger``.
"""

from .environment.registration import register

register()
