"""Inside the virtual machine: runs the commands that come over a virtio port, one after the other, as root.

A line of JSON each way: {"command", "longest_s"} brings {"status", "output", "errors"}. A command that takes longer is
killed and has status 124, as with timeout(1).
"""

import json
import os
import signal
import subprocess

PORT = "/dev/virtio-ports/commands"
TOO_LONG = 124


def run(command: str, longest_s: float) -> dict[str, int | str]:
    pipe = subprocess.PIPE
    with subprocess.Popen(
        ["/bin/bash", "-c", command], stdin=subprocess.DEVNULL, stdout=pipe, stderr=pipe, start_new_session=True
    ) as running:
        try:
            output, errors = running.communicate(timeout=longest_s)
            status = running.returncode
        except subprocess.TimeoutExpired:
            os.killpg(running.pid, signal.SIGKILL)
            output, errors = running.communicate()
            status = TOO_LONG
    return {"status": status, "output": output.decode(errors="replace"), "errors": errors.decode(errors="replace")}


def main() -> None:
    with open(PORT, "r+b", buffering=0) as port:
        port.write(b'{"ready": true}\n')
        waiting = b""
        while True:
            waiting += port.read(65536)
            while b"\n" in waiting:
                line, _, waiting = waiting.partition(b"\n")
                answer = json.dumps(run(**json.loads(line))).encode() + b"\n"
                while answer:
                    answer = answer[port.write(answer) :]


if __name__ == "__main__":
    main()
