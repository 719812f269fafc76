"""DAgger (Ross et al. 2011): a student acts, the teacher labels every state it comes to, all is learnt again.

Works on any environment of ``interfaces``; uses ``teacher`` and ``student``; needs torch and the extra
``policy``. Begin with ``loop``.
"""
