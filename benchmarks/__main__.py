# SPDX-License-Identifier: Apache-2.0
"""Print all measurements."""

from benchmarks import kernel, lockstep, recording, whole_process

if __name__ == '__main__':
    kernel.main()
    whole_process.main()
    lockstep.main()
    recording.main()
