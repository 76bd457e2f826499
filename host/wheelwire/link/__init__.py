"""The link to a robot: one session over one port, served by one thread.

session.py      hello, preparation, dispatch; no I/O in this, requests, setpoints and clock
requests.py     what is answered: repeats and time-outs; setpoints.py: what expires instead
arming.py       the zero setpoint that comes before a program's first one
clock.py        device time to host time, and its error
state_stream.py state frames to samples; latest_sample.py: where the newest one waits for `read`
port_loop.py    the thread that reads and writes; shared_thread.py: one for several ports;
                port_policy.py: baud rates, and opening a port again
device_link.py  what every link offers; connection.py: `Link`, which hands requests to that thread,
                and their answers to callers; inline_link.py: a link in virtual time, without a port
transports.py   a tty, a socket or a child process; discovery.py and port_list.py find boards
"""
