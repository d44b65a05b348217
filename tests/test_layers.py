"""The rules of the house about who may import whom, read from the source."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("handtrack", "synth", "calib")


def module_name(path):
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports_of(source):
    """Names of our own modules that ``source`` imports, wherever in it."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            # "from handtrack import rotation" imports a module, "from handtrack.x import f" may not
            found |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return {name for name in found if name.split(".")[0] in PACKAGES}


MODULES = {
    module_name(path): imports_of(path.read_text(encoding="utf-8"))
    for package in PACKAGES
    for path in sorted((ROOT / package).rglob("*.py"))
}


def inside(name, *packages):
    return any(name == package or name.startswith(f"{package}.") for package in packages)


def offenders(who, what):
    """``module -> import`` wherever a module that ``who`` picks imports one that ``what`` picks."""
    return sorted(
        f"{module} -> {name}"
        for module, names in MODULES.items()
        if who(module)
        for name in names
        if what(name)
    )


def is_outermost(module):
    """The public names, commands and the benchmark see everything; that is what they are for."""
    names = ("cli", "run", "loop", "source", "picture", "account", "bench", "batch", "live")
    outermost = [f"handtrack.{name}" for name in names]
    return module == "handtrack" or module.endswith(".commands") or inside(module, *outermost)


def test_imports_are_read():
    source = "import handtrack.palm\ndef f():\n    from handtrack import rotation\nimport numpy\n"
    assert imports_of(source) == {"handtrack.palm", "handtrack", "handtrack.rotation"}
    assert len(MODULES) > 30
    assert offenders(lambda m: inside(m, "handtrack.run"), lambda n: inside(n, "handtrack.output"))


@pytest.mark.parametrize("name", ["rotation", "records", "errors"])
def test_the_ground_floor_imports_nothing_of_ours(name):
    assert offenders(lambda m: m == f"handtrack.{name}", lambda n: True) == []


def test_palm_and_fingers_do_not_see_each_other():
    palm, fingers = "handtrack.palm", "handtrack.fingers"
    assert offenders(lambda m: inside(m, palm), lambda n: inside(n, fingers)) == []
    assert offenders(lambda m: inside(m, fingers), lambda n: inside(n, palm)) == []


def test_nothing_above_the_waist_imports_an_output():
    above = offenders(
        lambda m: inside(m, "handtrack") and not is_outermost(m) and "output" not in m,
        lambda n: inside(n, "handtrack.output"),
    )
    assert above == []


def test_no_output_knows_how_the_motion_was_measured():
    measuring = ("evidence", "palm", "fingers", "refine", "tracker", "run")
    packages = [f"handtrack.{name}" for name in measuring]
    found = offenders(
        lambda m: inside(m, "handtrack.output"), lambda n: inside(n, *packages, "synth", "calib")
    )
    assert found == []
    markers = offenders(
        lambda m: inside(m, "handtrack.output"), lambda n: inside(n, "handtrack.mocap")
    )
    # file formats, and our skeleton in one of them, are the same in both directions
    formats = ("bvh", "hand_motion", "marker_io", "markers", "motion")
    formats = tuple(f"handtrack.mocap.{name}" for name in formats)
    assert [line for line in markers if not inside(line.split(" -> ")[1], *formats)] == []


def test_only_the_outermost_imports_synth_and_calib():
    found = offenders(
        lambda m: inside(m, "handtrack") and not is_outermost(m),
        lambda n: inside(n, "synth", "calib"),
    )
    assert found == []


def test_synth_has_its_own_hand_and_renderer():
    allowed = (
        *("handtrack.errors", "handtrack.records", "handtrack.rotation", "handtrack.camera"),
        *("handtrack.hand.skeleton", "handtrack.hand.shape", "handtrack.mocap"),
    )
    found = offenders(
        lambda m: inside(m, "synth") and not is_outermost(m),
        lambda n: inside(n, "handtrack") and n != "handtrack" and not inside(n, *allowed),
    )
    assert found == []


def test_synth_and_calib_do_not_see_each_other():
    assert offenders(lambda m: inside(m, "synth"), lambda n: inside(n, "calib")) == []
    assert offenders(lambda m: inside(m, "calib"), lambda n: inside(n, "synth")) == []


def test_evidence_does_not_know_the_hand():
    hands = ("handtrack.palm", "handtrack.fingers", "handtrack.refine", "handtrack.tracker")
    found = offenders(lambda m: inside(m, "handtrack.evidence"), lambda n: inside(n, *hands))
    assert found == []


def test_nothing_reads_a_pickle_or_the_network():
    for path in (path for package in PACKAGES for path in (ROOT / package).rglob("*.py")):
        source = path.read_text(encoding="utf-8")
        assert "allow_pickle=True" not in source, path
        for node in ast.walk(ast.parse(source)):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            heads = {name.split(".")[0] for name in names}
            assert not heads & {"pickle", "joblib", "requests", "urllib", "urllib3"}, path
