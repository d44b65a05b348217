"""The commands ``handtrack space fit``, ``space report`` and ``space excerpt``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro

from handtrack.errors import InputError
from handtrack.hand import space as spaces
from handtrack.hand.fit import (
    DIMS,
    KEEP,
    SAMPLES,
    SEED,
    RecordedSet,
    fit_space,
    states_table,
    table,
)
from handtrack.mocap.excerpt import save_excerpt
from handtrack.mocap.recordings import read_folder, shipped_motion

Out = Annotated[Path, tyro.conf.arg(aliases=["-o"])]
DIMS_REPORTED = range(5, 11)


@dataclass(frozen=True)
class SpaceFit:
    """Fit the configuration space to recordings of hands.

    Without any folder given there is nothing to fit to; the space that comes with the package
    was made with --leap and --intel.
    """

    leap: Path | None = None
    """Folder of leapjs-playback recordings (JSON)."""
    intel: Path | None = None
    """Folder of hand_tracking_samples (animbank.pose)."""
    manipnet: Path | None = None
    """Folder of ManipNet recordings (BVH). Its licence, CC-BY-NC, then holds for the result."""
    out: Out = Path("space.npz")
    """Where to write the space."""
    dims: int = DIMS
    """Number of dimensions."""
    keep: int = KEEP
    """How many of the 32 basis states to keep; those with the least support fall."""
    samples: int = SAMPLES
    """Number of angle samples: half recorded, half drawn inside anatomical limits."""
    seed: int = SEED
    """Seed of the draws."""

    def __call__(self) -> int:
        """Fit, write, say what was done."""
        sets = read_sets(leap=self.leap, intel=self.intel, manipnet=self.manipnet)
        if not sets:
            raise InputError("no recordings to fit to: give --leap, --intel or --manipnet a folder")
        space = fit_space(list(sets.values()), self.dims, self.keep, self.samples, self.seed)
        space.save(self.out)
        print(describe(space))
        print(f"{self.out}: {space.n_dims} dimensions, {len(space.basis_curled)} basis states")
        return 0


@dataclass(frozen=True)
class SpaceReport:
    """Print how much variance the configuration space keeps, and which states it leaves out.

    Each cell is the share of the variance kept and, in brackets, the rms error of an angle in
    degrees. The folders are optional; what is not given is left out of the table.
    """

    space: Path | None = None
    """A space that `handtrack space fit` wrote; the package's own without."""
    leap: Path | None = None
    """Folder of leapjs-playback recordings (JSON)."""
    intel: Path | None = None
    """Folder of hand_tracking_samples (animbank.pose)."""
    manipnet: Path | None = None
    """Folder of ManipNet recordings (BVH)."""

    def __call__(self) -> int:
        """Print the tables."""
        space = spaces.load(self.space) if self.space else spaces.default()
        sets = read_sets(leap=self.leap, intel=self.intel, manipnet=self.manipnet)
        fitted = {source["source"] for source in space.provenance["sources"]}
        tests = {"motion in the package": shipped_motion().theta}
        for recorded in sets.values():
            known = "part of the fit" if recorded.source in fitted else "not in the fit"
            tests[f"{recorded.source} ({known})"] = recorded.theta
        print(describe(space))
        print()
        print(table(space, tests, DIMS_REPORTED))
        for name, recorded in sets.items():
            if recorded.source not in fitted:
                own = np.linalg.eigvalsh(np.cov(recorded.theta.T))[::-1].cumsum()
                shares = ", ".join(f"{100 * own[k - 1] / own[-1]:.1f} %" for k in DIMS_REPORTED)
                print(f"\nmost that any space of these dimensions keeps of {name}: {shares}")
        print()
        print(states_table(space, {n: r.theta for n, r in sets.items() if r.source not in fitted}))
        return 0


@dataclass(frozen=True)
class SpaceExcerpt:
    """Put together the recorded motion that comes with the package."""

    leap: Path
    """Folder of leapjs-playback recordings (JSON)."""
    intel: Path
    """Folder of hand_tracking_samples (animbank.pose)."""
    out: Out = Path("motion.npz")
    """Where to write it."""

    def __call__(self) -> int:
        """Cut, join and write."""
        recordings = [*read_folder("leap", self.leap), *read_folder("intel", self.intel)]
        print(f"{self.out}: {save_excerpt(self.out, recordings)} frames")
        return 0


def read_sets(**folders: Path | None) -> dict[str, RecordedSet]:
    """The trusted frames of each set that has a folder, by the set's name.

    Raises
    ------
    InputError
        A folder holds no recording of its set, or no frame that can be trusted.
    """
    sets = {}
    for kind, folder in folders.items():
        if folder is None:
            continue
        recordings = read_folder(kind, folder)
        theta = np.concatenate([recording.clean for recording in recordings])
        if not len(theta):
            raise InputError(f"{folder}: no frame of these {kind} recordings can be trusted")
        sets[kind] = RecordedSet(recordings[0].source, recordings[0].licence, theta)
    return sets


def describe(space: spaces.ConfigurationSpace) -> str:
    """What a space was fitted to, in a line or two."""
    p = space.provenance
    sources = ", ".join(
        f"{s['source']} ({s['licence']}, {s['frames']} frames)" for s in p["sources"]
    )
    drawn = ", ".join(f"{n} {kind}" for kind, n in p["sample"].items())
    return f"fitted to {sources}\nsample: {drawn}; seed {p['seed']}"
