"""A declared study of two conditions."""

import itertools

CONDITIONS = ("GaussGym", "R2S-EGO")


def declared(folder, text="", rules="", seeds=(1, 2, 3)):
    """A declaration of two conditions with these seeds in a folder, with the policies' files beside it."""
    policies = []
    for condition, seed in itertools.product(CONDITIONS, seeds):
        (folder / f"{condition}_{seed}.onnx").write_text(f"{condition} {seed}")
        policies.append(f'[[policies]]\ncondition = "{condition}"\nseed = {seed}\nfile = "{condition}_{seed}.onnx"\n')
    file = folder / "sitting.toml"
    file.write_text(
        f'name = "sitting"\nchairs = ["office chair", "stool"]\n{text}\n'
        "[chair]\nx_m = [2.0, 2.4]\ny_m = [-0.5, 0.5]\nheading_deg = [150.0, 180.0]\n"
        "[robot]\ndistance_m = [1.0, 1.5]\nbearing_deg = [-20.0, 20.0]\nfacing_deg = [-10.0, 10.0]\n"
        f"[rules]\n{rules}\n" + "".join(policies)
    )
    return file
