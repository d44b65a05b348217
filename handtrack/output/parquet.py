"""``tables.parquet``: both tables of a run in one, typed, with the unit of every column.

The columns are those of ``angles.csv``, then those of ``keypoints.csv`` that are not in it. Each
field's metadata has its ``unit`` (``s``, ``deg``, ``mm``, ``px`` or ``1``); that of the schema has
``handtrack``, a JSON object with format, version and the record of the run. What is not known is
null. Needs pyarrow (``pip install 'handtrack[parquet]'``).

>>> unit_of("index_pip_flexion_std_deg"), unit_of("wrist_x_px"), unit_of("palm_qw"), unit_of("side")
('deg', 'px', '1', '')
"""

import json
from pathlib import Path

from handtrack.errors import InputError, OutputError
from handtrack.trajectory import Trajectory, angle_columns, keypoint_columns

FORMAT = "handtrack-tables"
FORMAT_VERSION = 1

_UNITS = ("s", "deg", "mm", "px")
_NO_QUANTITY = ("frame", "status", "side")


def unit_of(column: str) -> str:
    """The unit of a column of ours; ``1`` for plain numbers, empty for names and counters."""
    if column in _NO_QUANTITY:
        return ""
    last = column.rpartition("_")[2]
    return last if last in _UNITS else "1"


def write_parquet(hand: Trajectory, path: Path) -> None:
    """Write both tables; call with a hidden name, the file grows in place.

    Raises
    ------
    InputError
        pyarrow is not installed.
    OutputError
        The file cannot be written.
    """
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError as error:
        raise InputError(
            "Parquet needs pyarrow, which is not installed: pip install 'handtrack[parquet]'"
        ) from error
    columns = angle_columns(hand) | keypoint_columns(hand)
    arrays, fields = [], []
    for name, values in columns.items():
        if values.dtype.kind == "U":
            array = pa.array([str(v) or None for v in values], pa.string())
        else:
            array = pa.array(values, from_pandas=True)  # NaN becomes null
        arrays.append(array)
        fields.append(pa.field(name, array.type, metadata={"unit": unit_of(name)}))
    note = {"format": FORMAT, "version": FORMAT_VERSION, "run": dict(hand.provenance)}
    schema = pa.schema(fields, metadata={"handtrack": json.dumps(note, ensure_ascii=False)})
    try:
        pq.write_table(pa.Table.from_arrays(arrays, schema=schema), path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from error
