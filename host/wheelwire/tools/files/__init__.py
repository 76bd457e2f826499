"""Every YAML file that Wheelwire reads; the answers of a set-up are beside its questions.

reading.py      reads a file, and says what is wrong: file, line, key, value, and the nearest name
yaml_text.py    YAML itself: no key twice, and the line of each key
robot.py        a robot's file, with the names that other packages use
board.py        a board, shipped or a user's own
parameters.py   the parameters of one robot, to set them on another
plant.py        a robot to simulate; bad_line.py: a bad line in front of it
"""
