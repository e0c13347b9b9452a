# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Writer of MCAP files in bulk.

The library mcap makes an object of every message and takes three times as long to write a run
(docs/development/decisions/log_writer.md). This package puts many messages into a chunk at once;
all other records (channels, metadata, indexes) are those of mcap.

`codec` packs and unpacks single records, `chunks` builds and checks chunks, and `record_stream`
writes a file from its header to its indexes and its footer.
"""
