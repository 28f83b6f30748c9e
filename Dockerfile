# foldcar in a container: docker build -t foldcar . && docker run --rm -v "$PWD:/work" -u "$(id -u):$(id -g)" foldcar new yard
#
# Every step is a script that `make release` and `make fresh` run too.

FROM debian:bookworm-slim AS build
RUN apt-get update -q && apt-get install -q -y --no-install-recommends make
COPY . /foldcar
RUN make -C /foldcar wheel

FROM debian:bookworm-slim
COPY --from=build /foldcar/dist /foldcar/dist
COPY --from=build /foldcar/tools/install_system_packages.sh /foldcar/tools/install_wheel.sh /foldcar/tools/
COPY --from=build /foldcar/host/requirements.txt /foldcar/host/requirements-dev.txt /foldcar/host/
RUN /foldcar/tools/install_wheel.sh /foldcar/dist/*linux*.whl /opt/foldcar '[all]' \
  && rm -rf /foldcar /root/.cache /var/lib/apt/lists/*
RUN useradd --create-home foldcar && mkdir /work && chown foldcar /work
USER foldcar
WORKDIR /work
# Where a caller's user has no home folder.
ENV MPLCONFIGDIR=/tmp/matplotlib
ENTRYPOINT ["/opt/foldcar/bin/foldcar"]
