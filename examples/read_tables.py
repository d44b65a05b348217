"""A run's tables in pandas: how far each joint moved: python examples/read_tables.py [RUN]."""

import pandas as pd
import sample

folder = sample.argument() or sample.run()
angles = pd.read_csv(folder / "angles.csv")  # an empty field is NaN: not known
seen = angles[angles["status"] == "tracked"]

bends = [name for name in angles.columns if name.endswith("_flexion_deg")]
summary = seen[bends].agg(["min", "max", "mean"]).T
summary["range"] = summary["max"] - summary["min"]
print(summary.round(1).to_string())
print(f"{len(seen)} of {len(angles)} frames tracked")
