"""The capture-anchored geometry proxy: observed, prior and completed surfaces."""
