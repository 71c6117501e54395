"""A workbench that serves a subject from a thread, as ``mbw open`` does from a command."""

import http.client
import json
from contextlib import contextmanager

import numpy as np

from identification.words.file_access import temporary_folder
from mbw.workbench.desk import Desk
from mbw.workbench.jobs import JobQueue
from mbw.workbench.server import serve_beside
from mbw.workbench.state_log import log_path, open_log
from mbw.workbench.workbench_page import Workbench


@contextmanager
def serve(subject, name="work", budget=None, **tasks):
    """Yield the server of a subject; its log lies where XDG_STATE_HOME says."""
    first = subject.first_state()
    path = log_path(subject.path, name, first)
    with temporary_folder() as place, open_log(path, first) as log:
        desk = Desk(subject, log, place, budget)
        bound = {key: lambda task=task: task(desk) for key, task in tasks.items()}
        jobs = JobQueue(path.with_suffix(".jobs"), desk.adopt)
        jobs.show_again()
        jobs.begin()
        with serve_beside(Workbench(desk, jobs, bound)) as server:
            yield server
        jobs.close()


def frame_parts(frame):
    """Header and arrays of a frame, as the page reads them."""
    size = int.from_bytes(frame[:4], "little")
    header, numbers = json.loads(frame[4 : 4 + size]), np.frombuffer(frame[4 + size :], "<f4")
    places = header["arrays"].items()
    return header, {name: numbers[first : first + count] for name, (first, count) in places}


class Browser:
    """Requests as a browser makes them, with what each test changes."""

    def __init__(self, server):
        self.server, self.cookie = server, ""
        self.cookie = self.ask("GET", server.address.removeprefix(f"http://{server.host}"))[1][
            "Set-Cookie"
        ]

    def ask(self, method, path, content=None, **changed):
        host, _, port = self.server.host.partition(":")
        line = http.client.HTTPConnection(host, int(port), timeout=20)
        headers = {"Host": self.server.host, "Cookie": self.cookie.partition(";")[0]}
        if method == "POST":
            headers["Origin"] = f"http://{self.server.host}"
        headers = {**headers, **{key.replace("_", "-"): text for key, text in changed.items()}}
        body = None if content is None else json.dumps(content)
        line.request(method, path, body, {k: v for k, v in headers.items() if v is not None})
        answer = line.getresponse()
        done = answer.status, dict(answer.getheaders()), answer.read()
        line.close()
        return done
