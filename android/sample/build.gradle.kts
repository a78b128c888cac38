plugins {
    alias(libs.plugins.android.application)
    alias(libs.plugins.kotlin.android)
}

android {
    namespace = "org.phasefront.sample"
    compileSdk = 36

    defaultConfig {
        applicationId = "org.phasefront.sample"
        minSdk = 26
        targetSdk = 36
        versionCode = 1
        versionName = "1"
        ndk { abiFilters += listOf("arm64-v8a", "x86_64") }
    }

    compileOptions {
        sourceCompatibility = JavaVersion.VERSION_17
        targetCompatibility = JavaVersion.VERSION_17
    }

    buildTypes {
        release {
            // With R8, so that the library's consumer rules are tested with the sample.
            isMinifyEnabled = true
            proguardFiles(getDefaultProguardFile("proguard-android-optimize.txt"))
            signingConfig = signingConfigs.getByName("debug")
        }
    }

    sourceSets["main"].apply {
        // `core` has no class of Android's but org.json: it is tested on a JVM, by pom.xml and tests/kotlin.
        kotlin.srcDir("src/core/kotlin")
        // The sample scene is the project's.
        assets.srcDir("../../samples")
    }
}

kotlin { compilerOptions { jvmTarget.set(org.jetbrains.kotlin.gradle.dsl.JvmTarget.JVM_17) } }

dependencies {
    implementation(project(":phasefront"))
}
