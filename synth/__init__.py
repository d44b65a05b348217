"""Films of a hand whose every angle is known: the truth that the tracker is measured against.

::

    scene.toml -> motion (angles, palm pose) -> hand (mesh, skin) -> render -> sensor -> clip.mp4
                                 \\-------------------------------------------> truth.npz

``synth`` has a surface, kinematics and renderers of its own and shares only the names, the order
and the sign of the 20 angles with ``handtrack``: were the pictures drawn with the surface that
the likelihood predicts with, accuracy would be measured against itself.
"""
