"""Headless Chromium for the tests of pages, which click, press, look and listen for complaints."""

import itertools
import json
import os
import select
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
ON_3_AND_4 = (
    "import os, sys; r, w, *c = sys.argv[1:]; os.dup2(int(r), 3); os.dup2(int(w), 4); os.execv(c[0], c)"
)


class Browser:
    """Headless Chromium, driven by the DevTools protocol over the pipe it reads on 3 and writes on 4."""

    def __init__(self, profile: Path) -> None:
        import fcntl  # only where there are pipes by number

        assert CHROMIUM
        ends = [fcntl.fcntl(end, fcntl.F_DUPFD, 10) for pipe in (os.pipe(), os.pipe()) for end in pipe]
        theirs_in, ours_out, ours_in, theirs_out = ends
        flags = "headless no-sandbox disable-gpu disable-quic no-first-run disable-background-networking"
        flags += " disable-component-update disable-sync disable-dev-shm-usage remote-debugging-pipe"
        command = [sys.executable, "-c", ON_3_AND_4, str(theirs_in), str(theirs_out), CHROMIUM]
        command += [f"--{flag}" for flag in (*flags.split(), f"user-data-dir={profile}")]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        # a session of its own, so that its helpers, which hold the pipe open, can be ended with it
        self.process = subprocess.Popen(
            command, pass_fds=(theirs_in, theirs_out), start_new_session=True, **quiet
        )
        for end in (theirs_in, theirs_out):
            os.close(end)
        self.out, self.into, self.heard = os.fdopen(ours_out, "wb", 0), os.fdopen(ours_in, "rb", 0), b""
        self.numbers, self.events, self.session = itertools.count(1), [], {}
        target = self.ask("Target.createTarget", url="about:blank")["targetId"]
        self.session = {
            "sessionId": self.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        }
        for domain in ("Network", "Log", "Runtime", "Page"):
            self.ask(f"{domain}.enable")

    def __enter__(self) -> "Browser":
        return self

    def __exit__(self, *_: object) -> None:
        os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        self.out.close()
        self.into.close()

    def read(self) -> dict[str, Any]:
        while b"\0" not in self.heard:
            answering, _, _ = select.select([self.into], [], [], 60)
            said = self.into.read(65536) if answering else b""
            if not said:
                raise EOFError("Chromium ended, or has said nothing for a minute")
            self.heard += said
        message, _, self.heard = self.heard.partition(b"\0")
        return json.loads(message)

    def ask(self, method: str, **params: Any) -> dict[str, Any]:
        number = next(self.numbers)
        self.out.write(
            json.dumps({"id": number, "method": method, "params": params, **self.session}).encode() + b"\0"
        )
        while (message := self.read()).get("id") != number:
            self.events.append(message)
        assert "error" not in message, message
        return message["result"]

    def evaluate(self, expression: str) -> Any:
        return self.ask("Runtime.evaluate", expression=expression, awaitPromise=True)["result"].get("value")

    def complaints(self, page: Path) -> list[str]:
        """Open a page; what it printed to the console and what it asked the network for beside itself."""
        self.events.clear()
        self.ask("Page.navigate", url=page.as_uri())
        while not any(event["method"] == "Page.loadEventFired" for event in self.events):
            self.events.append(self.read())
        self.evaluate("new Promise(resolve => setTimeout(resolve, 200))")
        found = []
        for event in self.events:
            match event["method"], event["params"]:
                case "Network.requestWillBeSent", {"request": {"url": url}}:
                    if url != page.as_uri() and not url.startswith("data:"):
                        found.append(f"request {url}")
                case "Log.entryAdded", {"entry": {"text": text}}:
                    found.append(f"log {text}")
                case "Runtime.consoleAPICalled" | "Runtime.exceptionThrown" as what, params:
                    found.append(f"{what} {params}")
        return found
