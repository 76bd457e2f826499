"""What crossed a link: recorded, shared with other programs, read, run again, explained.

| module | subject |
|-|-|
| `share` | one robot, several programs: one holds its port, the others read and stop it |
| `why` | why a robot stopped |
| `recorder` | records a link, in a thread of its own, to an MCAP file |
| `reader` | what a file holds, also one that has no end |
| `repair` | writes the end of a file that a crash has left without one |
| `summary` | a recording in a few numbers, by its end |
| `rerun` | the messages that crossed a link, and its session run again |
| `replay` | a link to what was recorded: the same samples, in their own time or step by step |
| `plot` | what a recording shows over time, and its picture |
| `views`, `ros_messages` | what viewers show, made while a link is recorded; its ROS 2 messages |
"""
