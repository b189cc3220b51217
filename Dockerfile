# wavelume as a service: built with the official Rust image, run as an ordinary user on a small Debian.
FROM rust:1.95-slim AS build
RUN apt-get update && apt-get install -y --no-install-recommends gcc libc6-dev && rm -rf /var/lib/apt/lists/*
WORKDIR /build
COPY . .
# The commit that `wavelume --version` shows: docker build --build-arg WAVELUME_COMMIT=$(git rev-parse HEAD) .
ARG WAVELUME_COMMIT
RUN cargo build --locked --release && strip -o /wavelume target/release/wavelume

FROM debian:stable-slim
RUN useradd --system --uid 10001 --no-create-home wavelume && install -d -o wavelume -g wavelume /data
COPY --from=build /wavelume /usr/local/bin/wavelume
COPY LICENSE-MIT LICENSE-APACHE /usr/share/doc/wavelume/
COPY data/SOURCES.md docs/sbom.cdx.json /usr/share/doc/wavelume/
USER wavelume
VOLUME /data
EXPOSE 8080
HEALTHCHECK --interval=30s --timeout=6s --start-period=10s CMD ["wavelume", "health"]
STOPSIGNAL SIGTERM
ENTRYPOINT ["wavelume"]
# Requests need a key. WAVELUME_BOOTSTRAP_KEY is the first one (`wavelume keys generate` prints one).
CMD ["serve", "--data", "/data", "--auth", "keys", "--listen", "0.0.0.0:8080"]
