# The command skysweep with the system's GDAL and PROJ:
#
#     docker build -t skysweep .
#     docker run --rm -u "$(id -u):$(id -g)" -v "$PWD:/data" skysweep dsm left.tif right.tif -o out
FROM rust:1.95-slim-bookworm AS build
RUN apt-get update -qq \
    && apt-get install -y -qq --no-install-recommends libgdal-dev pkg-config libsqlite3-dev g++ \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /source
COPY . .
RUN CARGO_INCREMENTAL=0 cargo build --release --locked --bin skysweep

FROM debian:bookworm-slim
# proj-data holds the geoid grids that Debian may ship; --fetch-grids fetches others.
RUN apt-get update -qq \
    && apt-get install -y -qq --no-install-recommends libgdal32 libproj25 proj-bin proj-data \
    && rm -rf /var/lib/apt/lists/*
COPY --from=build /source/target/release/skysweep /usr/local/bin/skysweep
COPY LICENSE-MIT LICENSE-APACHE /usr/local/share/doc/skysweep/
RUN ["skysweep", "selftest"]
WORKDIR /data
ENTRYPOINT ["skysweep"]
CMD ["--help"]
