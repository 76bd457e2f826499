"""Why a robot stopped, from what crossed its link: live, or from a recording.

records -> `history`: what was seen recently -> `diagnosis`: one stop after the other
                                            -> `wheel_fault`: what a wheel did before its fault
a device's black box -> `black_box`: its stop, its re-run
a device's own reports -> `device`: with all its boxes, its ledger, and how it stands now
`causes`: each cause's sentence, and what to look at first
`watch`: live, while a program drives; `explanation`: the cause in a refused call's error
"""
