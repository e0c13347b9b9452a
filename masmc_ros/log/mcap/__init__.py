# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Writer of MCAP files in bulk.

The library mcap makes an object of every record and takes three times the time of this one to
write a run (docs/decisions/log_writer.md). The records themselves (channels, metadata, indexes)
are those of mcap; this package puts many messages into a chunk at once.

`records` packs and unpacks single records, `chunks` builds and checks chunks, and `record_stream`
writes a file from its header to its indexes and its footer.
"""
