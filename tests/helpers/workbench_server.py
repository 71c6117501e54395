"""A workbench that serves a subject from a thread, as ``mbw open`` does from a command."""

import threading
from contextlib import contextmanager

from mbw.workbench.desk import Desk
from mbw.workbench.frames import FrameMaker
from mbw.workbench.server import PageServer, Workbench
from mbw.workbench.state_log import log_path, open_log


@contextmanager
def serve(subject, name="work", **tasks):
    """Yield the server of a subject; its log lies where XDG_STATE_HOME says."""
    first = subject.first_state()
    with open_log(log_path(subject.path, name, first), first) as log:
        desk = Desk(FrameMaker(subject), log)
        bound = {key: lambda task=task: task(desk) for key, task in tasks.items()}
        with PageServer(Workbench(desk, bound)) as server:
            thread = threading.Thread(target=server.serve_forever, daemon=True)
            thread.start()
            yield server
            server.shutdown()
            thread.join(10)
