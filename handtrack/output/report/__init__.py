"""``report.html``: one page that shows a run frame by frame, from disk, offline, with no server.

::

    report.html             page, style, scripts, plotting library, and the curves of the whole clip
    report_files/000000.js  120 frames: their pictures and their layers, loaded when they are near
    report_files/times.js   milliseconds of each frame, the only thing that differs between two runs

A page from disk may not read files but may run scripts, so everything comes as one. Numbers are
quantised columns (:mod:`~handtrack.output.report.columns`), deflated, in base64. Pictures are H.264
packets (:mod:`~handtrack.output.report.film`), decoded by the browser one by one with the frame's
own number as their time stamp, so that the layers drawn are always those of the frame shown.
"""
