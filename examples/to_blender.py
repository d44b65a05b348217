"""A run as BVH, and the lines that import it in Blender: python examples/to_blender.py [RUN].

Metres, so that the hand has its true size; without ``update_scene_fps`` Blender plays every clip
at the scene's own rate.
"""

import sample

from handtrack.output.export import Export, export_run

[path] = export_run(Export(sample.argument() or sample.run(), to="bvh", unit="m"))
print(
    "import bpy\n"
    f"bpy.ops.import_anim.bvh(filepath={str(path.resolve())!r},\n"
    "                        update_scene_fps=True, update_scene_duration=True)"
)
