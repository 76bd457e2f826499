"""What crossed a link: recorded, shared with other programs, read, run again, explained.

| module | subject |
|-|-|
| `share` | one robot, several programs: one holds its port, the others read and stop it |
| `why` | why a robot stopped |
| `black_box` | a device's black box: a file of it, and its re-run |
| `cdr` | ROS 2 messages, laid out field by field |
| `frames` | the messages that crossed the link, one by one |
| `messages` | the ROS 2 messages that viewers know, and their definitions |
| `plot` | a picture of a trace |
| `raw` | the tap's records as messages of a file |
| `reader` | what a file holds, also one that has no end |
| `recorder` | records a link, in a thread of its own |
| `repair` | writes the end of a file that a crash has left without one |
| `replay` | a link to what was recorded: the same samples, in their own time or step by step |
| `rerun`, `rerun_link` | a session run again from its records, and a link to it |
| `summary` | a recording in a few numbers |
| `trace` | what a recording shows over time |
| `views` | what viewers show, made while it is recorded |
| `writer` | a file that is being written |
"""
